"""A calibration's diagnosis as one page for a browser: tables, picture and warnings, nothing fetched, nothing run."""

import base64
from html import escape
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.plots.body_picture import body_png
from bodycam_ros.plots.picture_style import FAINT, INK, PAGE_POLICY, QUIET, WARNING
from bodycam_ros.plots.report_tables import ReportTable, report_tables, summary_line
from bodycam_ros.whole_file import write_whole

_STYLE = f"""
body {{ margin: 2rem auto; max-width: 76rem; padding: 0 1rem; font: 15px/1.45 "DejaVu Sans", sans-serif; color: {INK} }}
h1 {{ font-size: 1.5rem; margin: 0 }}
h2 {{ font-size: 1.1rem; margin: 2rem 0 0 }}
p {{ margin: 0.3rem 0 0.6rem; color: {QUIET} }}
img {{ width: 100%; margin-top: 1rem }}
.scroll {{ overflow-x: auto }}
table {{ border-collapse: collapse; font-size: 13px; font-variant-numeric: tabular-nums }}
th, td {{ padding: 0.25rem 0.8rem 0.25rem 0; text-align: left; vertical-align: top; border-bottom: 1px solid {FAINT} }}
th {{ font-weight: normal; color: {QUIET}; vertical-align: bottom }}
.number {{ text-align: right; white-space: nowrap }}
.flagged, .warnings {{ color: {WARNING} }}
"""


def write_html_report(body: BodyModel, diagnosis: CalibrationDiagnosis, path: Path) -> None:
    """Write the page, whole or not at all.

    Raises:
        OutputError: the file cannot be written.
    """
    write_whole(path, html_report(body, diagnosis))


def html_report(body: BodyModel, diagnosis: CalibrationDiagnosis) -> str:
    """The page as an HTML 5 document."""
    title = escape(f"Body {body.name}")
    picture = base64.b64encode(body_png(body, diagnosis)).decode("ascii")
    parts = [
        "<!DOCTYPE html>",
        '<html lang="en">',
        "<head>",
        '<meta charset="utf-8">',
        PAGE_POLICY,
        '<meta name="viewport" content="width=device-width">',
        f"<title>{title}</title>",
        f"<style>{_STYLE}</style>",
        "</head>",
        "<body>",
        f"<h1>{title}</h1>",
        f"<p>{escape(summary_line(diagnosis))}</p>",
        *_warnings(diagnosis.warnings),
        f'<img src="data:image/png;base64,{picture}" alt="{title} in the N-pose, and a row of figures per joint">',
        *(line for table in report_tables(diagnosis) for line in _table(table)),
        "</body>",
        "</html>",
    ]
    return "\n".join(parts) + "\n"


def _warnings(warnings: tuple[str, ...]) -> list[str]:
    if not warnings:
        return ["<p>No warnings.</p>"]
    listed = [f"<li>{escape(warning)}</li>" for warning in warnings]
    return ["<h2>Look at</h2>", '<ol class="warnings">', *listed, "</ol>"]


def _table(table: ReportTable) -> list[str]:
    kinds = ["" if index in table.text_columns else ' class="number"' for index in range(len(table.columns))]
    headings = [f'<th scope="col"{kind}>{escape(text)}</th>' for kind, text in zip(kinds, table.columns, strict=True)]
    lines = [
        f"<h2>{escape(table.title.capitalize())}</h2>",
        f"<p>{escape(table.note)}</p>",
        '<div class="scroll">',
        "<table>",
        f"<thead><tr>{''.join(headings)}</tr></thead>",
        "<tbody>",
    ]
    for index, row in enumerate(table.rows):
        flagged = ' class="flagged"' if index in table.flagged else ""
        cells = [f"<td{kind}>{escape(text)}</td>" for kind, text in zip(kinds, row, strict=True)]
        lines.append(f"<tr{flagged}>{''.join(cells)}</tr>")
    return [*lines, "</tbody>", "</table>", "</div>"]
