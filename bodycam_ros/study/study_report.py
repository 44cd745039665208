"""The table over all recordings of a study: as a page, as Markdown and as CSV."""

import csv
import io
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

from bodycam_ros.evaluate.page.page import Block, Heading, Link, Page, Table, Text
from bodycam_ros.study.recording_result import RecordingResult
from bodycam_ros.study.study_columns import COLUMNS, shown_columns
from bodycam_ros.whole_file import whole_files

_REPORT = "report.html"  # of an evaluation, whose module draws too, and takes a second to load
_VERDICTS = ("good", "doubtful", "wrong", "failed", "not done", "unreadable")
PAGE, MARKDOWN, CSV = "study.html", "study.md", "study.csv"


def write_study_report(title: str, results: Sequence[RecordingResult], folder: Path) -> None:
    """Write page, Markdown and CSV; earlier ones are replaced, if they say something else.

    Args:
        title: of the study.
        results: of all its recordings.
        folder: of the study.

    Raises:
        OutputError: they cannot be written.
    """
    table = study_csv(results, folder)
    if _says(folder / CSV, table) and (folder / PAGE).exists() and (folder / MARKDOWN).exists():
        return
    from bodycam_ros.evaluate.page.write_page import html, markdown  # loads what draws, for its colours

    page = study_page(title, results, folder)
    with whole_files(folder) as unfinished:
        (unfinished / PAGE).write_text(html(page, unfinished), encoding="utf-8")
        (unfinished / MARKDOWN).write_text(markdown(page), encoding="utf-8")
        (unfinished / CSV).write_text(table, encoding="utf-8")


def study_page(title: str, results: Sequence[RecordingResult], folder: Path) -> Page:
    """The page.

    Args:
        title: of the study.
        results: of all its recordings.
        folder: that the page will lie in.
    """
    columns = shown_columns(results)
    rows = [
        (_name(result, folder), result.recording.subject, result.recording.place, result.verdict)
        + tuple(column.cell(result) for column in columns)
        for result in results
    ]
    blocks: list[Block] = [
        Text(f"{counted(results)}."),
        Table(("recording", "subject", "place", "verdict", *(column.heading for column in columns)), rows),
    ]
    if failed := [result for result in results if result.failed is not None]:
        blocks += [
            Heading("Not done"),
            Table(("recording", "step", "why"), [(r.recording.name, *told_failure(r)) for r in failed]),
        ]
    return Page(title, tuple(blocks))


def study_csv(results: Sequence[RecordingResult], folder: Path) -> str:
    """A row a recording; what is not known is empty, shares are from 0 to 1.

    Args:
        results: of all recordings.
        folder: that reports are named from.
    """
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    columns = [column.key for column in COLUMNS]
    writer.writerow(["recording", "subject", "place", "verdict", *columns, "report", "failed_step", "reason"])
    for result in results:
        values = [column.of(result) for column in COLUMNS]
        report = "" if result.failed is not None else result.report.relative_to(folder).as_posix()
        said = ["" if value is None else f"{value:.6g}" for value in values]
        recording = result.recording
        failure = told_failure(result) if result.failed is not None else ("", "")
        writer.writerow([recording.name, recording.subject, recording.place, result.verdict, *said, report, *failure])
    return text.getvalue()


def counted(results: Sequence[RecordingResult]) -> str:
    """How many recordings came to which verdict."""
    counts = Counter(result.verdict for result in results)
    what = "recording" if len(results) == 1 else "recordings"
    told = (f"{counts[word]} {word}" for word in _VERDICTS if counts[word])
    return f"{len(results)} {what}: {', '.join(told)}"


def told_failure(result: RecordingResult) -> tuple[str, str]:
    """The step that is not done, and why."""
    step = result.failed.name if result.failed is not None else ""
    return step, result.reason or "was not begun"


def _name(result: RecordingResult, folder: Path) -> str | Link:
    name = result.recording.name
    page = result.report / _REPORT
    return name if result.failed is not None else Link(name, page.relative_to(folder).as_posix())


def _says(path: Path, text: str) -> bool:
    try:
        return path.read_text(encoding="utf-8") == text
    except (OSError, ValueError):
        return False
