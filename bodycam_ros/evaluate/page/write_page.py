"""Writes a page as Markdown, whose pictures lie beside it, and as one HTML file that needs nothing else."""

import base64
from collections.abc import Sequence
from html import escape
from pathlib import Path
from urllib.parse import quote

from bodycam_ros.drawing.page_policy import PAGE_POLICY
from bodycam_ros.drawing.picture_style import FAINT, INK, QUIET
from bodycam_ros.evaluate.page.page import Heading, Link, Page, Picture, Table, Text

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
