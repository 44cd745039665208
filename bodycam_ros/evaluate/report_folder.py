"""Writes an evaluation into a folder: all of its files or none."""

import base64
import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from html import escape
from pathlib import Path
from types import MappingProxyType
from urllib.parse import quote

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.agreement_pictures import cameras_shown, draw_bland_altman, draw_joints, draw_ways
from bodycam_ros.evaluate.agreement_section import BLAND_ALTMAN, JOINTS, WAYS, agreement_section
from bodycam_ros.evaluate.close_ups import CloseUp
from bodycam_ros.evaluate.constraint_section import CONSTRAINTS, HELD_WAYS, constraint_section, draw_constraints
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.gait_section import GAIT, draw_gait, gait_section
from bodycam_ros.evaluate.held_points import draw_ways_with_and_without
from bodycam_ros.evaluate.overlay_picture import OverlayView, draw_overlays
from bodycam_ros.evaluate.page import Block, Heading, Link, Page, Picture, Table, Text
from bodycam_ros.evaluate.summary import summary
from bodycam_ros.evaluate.summary_picture import draw_summary
from bodycam_ros.plots.picture_style import FAINT, INK, PAGE_POLICY, QUIET
from bodycam_ros.whole_file import whole_files

MARKDOWN, HTML = "report.md", "report.html"
PAGE_FILES = (MARKDOWN, HTML, WAYS, JOINTS, BLAND_ALTMAN, GAIT, CONSTRAINTS, HELD_WAYS)
"""Names of the page and of the pictures that are of it alone."""


def report_pictures(evaluation: Evaluation, close_ups: Sequence[CloseUp] = ()) -> Mapping[str, Callable[[Path], None]]:
    """Name of a file -> draws it, of all pictures that are of the page alone.

    Args:
        evaluation: what was found.
        close_ups: what static cameras saw with equipment and without.
    """
    found: dict[str, Callable[[Path], None]] = {}
    if (agreement := evaluation.agreement) is not None:
        found[WAYS] = partial(draw_ways, evaluation.solved, agreement)
        found[JOINTS] = partial(draw_joints, evaluation.solved, agreement)
        if agreement.angles:
            found[BLAND_ALTMAN] = partial(draw_bland_altman, agreement)
    if evaluation.gait is not None:
        found[GAIT] = partial(draw_gait, evaluation.gait, evaluation.true_gait)
    if (both := evaluation.constraints) is not None:
        found[CONSTRAINTS] = partial(draw_constraints, both, close_ups)
        found[HELD_WAYS] = partial(draw_ways_with_and_without, both)
    return found


def report_page(evaluation: Evaluation, pictures: Mapping[str, str]) -> Page:
    """The page.

    Args:
        evaluation: what was found.
        pictures: file -> caption of pictures that are in the folder besides.
    """
    solved = evaluation.solved
    duration_s = 1e-9 * (solved.end_ns - solved.start_ns + solved.frame_ns)
    blocks: list[Block] = [
        Text(f"{duration_s:.2f} s, {len(solved.stamps_ns)} instants. Verdict: {evaluation.verdict.text}."),
    ]
    if evaluation.agreement is not None:
        blocks += agreement_section(evaluation.agreement, bool(cameras_shown(solved, evaluation.agreement)))
    if evaluation.gait is not None:
        blocks += gait_section(evaluation.gait, evaluation.true_gait)
    if evaluation.constraints is not None:
        blocks += constraint_section(evaluation.constraints)
    blocks += [Picture(file, caption) for file, caption in pictures.items()]
    return Page(solved.path.resolve().name, tuple(blocks))


_STYLE = f"""
body {{ margin: 2rem auto; max-width: 76rem; padding: 0 1rem; font: 15px/1.45 "DejaVu Sans", sans-serif; color: {INK} }}
h1 {{ font-size: 1.5rem; margin: 0 0 0.5rem }}
h2 {{ font-size: 1.1rem; margin: 2rem 0 0.3rem }}
p, figcaption {{ margin: 0.3rem 0 0.6rem; max-width: 60rem }}
figcaption {{ color: {QUIET} }}
figure {{ margin: 1rem 0 }}
img {{ max-width: 100% }}
.scroll {{ overflow-x: auto }}
table {{ border-collapse: collapse; margin: 0.5rem 0; font-size: 13px; font-variant-numeric: tabular-nums }}
th, td {{ padding: 0.25rem 1rem 0.25rem 0; text-align: right; white-space: nowrap; border-bottom: 1px solid {FAINT} }}
th:first-child, td:first-child {{ text-align: left }}
th {{ font-weight: normal; color: {QUIET} }}
"""


def markdown(page: Page) -> str:
    """The page as Markdown with tables."""
    lines = [f"# {_plain(page.title)}", ""]
    for block in page.blocks:
        match block:
            case Heading(text):
                lines += [f"## {_plain(text)}", ""]
            case Text(text):
                lines += [_plain(text), ""]
            case Table(columns, rows):
                lines += [_row(columns), _row(["---", *["---:"] * (len(columns) - 1)]), *map(_row, rows), ""]
            case Picture(file, caption):
                lines += [f"![{_plain(caption)}]({file})", "", f"*{_plain(caption)}*", ""]
    return "\n".join(lines)


def html(page: Page, folder: Path) -> str:
    """The page as HTML 5, with the pictures of a folder in it.

    Raises:
        OSError: a picture cannot be read.
    """
    title = escape(page.title)
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
    ]
    for block in page.blocks:
        match block:
            case Heading(text):
                parts.append(f"<h2>{escape(text)}</h2>")
            case Text(text):
                parts.append(f"<p>{escape(text)}</p>")
            case Table(columns, rows):
                parts += ['<div class="scroll"><table>', f"<thead>{_cells('th', columns)}</thead>", "<tbody>"]
                parts += [_cells("td", row) for row in rows]
                parts += ["</tbody></table></div>"]
            case Picture(file, caption):
                data = base64.b64encode((folder / file).read_bytes()).decode("ascii")
                image = f'<img src="data:image/png;base64,{data}" alt="{escape(caption)}">'
                parts.append(f"<figure>{image}<figcaption>{escape(caption)}</figcaption></figure>")
    return "\n".join([*parts, "</body>", "</html>"]) + "\n"


def _cells(kind: str, row: Sequence[str | Link]) -> str:
    return "<tr>" + "".join(f"<{kind}>{_html(cell)}</{kind}>" for cell in row) + "</tr>"


def _html(cell: str | Link) -> str:
    return f'<a href="{quote(cell.target)}">{escape(cell.text)}</a>' if isinstance(cell, Link) else escape(cell)


def _row(cells: Sequence[str | Link]) -> str:
    return "| " + " | ".join(map(_marked, cells)) + " |"


def _marked(cell: str | Link) -> str:
    if isinstance(cell, Link):
        return f"[{_marked(cell.text)}]({quote(cell.target)})"
    return _plain(cell).replace("|", "\\|")


def _plain(text: str) -> str:
    """Text whose signs mean nothing in Markdown."""
    return "".join(f"\\{sign}" if sign in "\\`*_[]<>#" else sign for sign in text.replace("\n", " "))


FIGURES, PICTURE, OVERLAY = "summary.json", "summary.png", "overlay.png"
OUTSIDE, FEET, VIDEO = "outside.png", "feet.png", "outside.mp4"
WRITTEN = (PICTURE, OVERLAY, OUTSIDE, FEET, VIDEO, *PAGE_FILES)
"""Names of what may be written beside the figures."""

_CAPTIONS = {
    PICTURE: "The recording at a glance.",
    OVERLAY: "What worn cameras saw, with limbs and landmarks where the body puts them.",
    OUTSIDE: "What static cameras saw, with the body's contour and the forces on it.",
    FEET: "Ways of the balls of the feet.",
}


def check_report_folder(folder: Path) -> None:
    """Refuse a place that cannot become a report folder, before the work is done.

    Raises:
        RecordingError: it is a file, or a bag, which a report has no business in.
    """
    if folder.exists() and not folder.is_dir():
        raise RecordingError(f"{folder}: is a file; give a folder for {FIGURES} and {PICTURE}")
    if (folder / "metadata.yaml").exists():
        raise RecordingError(f"{folder}: is a ros2 bag folder; give another folder for {FIGURES} and {PICTURE}")


def write_report(
    evaluation: Evaluation,
    folder: Path,
    overlay: Sequence[OverlayView] = (),
    more: Mapping[str, Callable[[Path], None]] = MappingProxyType({}),
    close_ups: Sequence[CloseUp] = (),
) -> None:
    """Write figures, pictures and the page with them, as Markdown and as HTML; earlier ones are replaced.

    Args:
        evaluation: what was found.
        folder: to write to.
        overlay: views of worn cameras.
        more: name of another file -> writes it to a path.
        close_ups: what static cameras saw with equipment and without.

    Raises:
        RecordingError: the place cannot become a report folder.
        OutputError: it cannot be written.
    """
    check_report_folder(folder)
    with whole_files(folder) as unfinished:
        (unfinished / FIGURES).write_text(json.dumps(summary(evaluation), indent=1, allow_nan=False) + "\n")
        draw_summary(evaluation, unfinished / PICTURE)
        if overlay:
            draw_overlays(overlay, unfinished / OVERLAY)
        for name, draw in more.items():
            draw(unfinished / name)
        for name, draw in report_pictures(evaluation, close_ups).items():
            draw(unfinished / name)
        captions = {name: caption for name, caption in _CAPTIONS.items() if (unfinished / name).exists()}
        page = report_page(evaluation, captions)
        (unfinished / MARKDOWN).write_text(markdown(page), encoding="utf-8")
        (unfinished / HTML).write_text(html(page, unfinished), encoding="utf-8")
