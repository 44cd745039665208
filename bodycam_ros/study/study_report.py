"""The table over all recordings of a study: as a page, as Markdown and as CSV."""

import csv
import io
import json
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bodycam_ros.evaluate.page import Block, Heading, Link, Page, Table, Text, number
from bodycam_ros.study.steps import Step
from bodycam_ros.study.study import Recording, Study, StudySteps
from bodycam_ros.study.workflow_folder import WorkflowFolder
from bodycam_ros.whole_file import whole_files

_FIGURES = "summary.json"  # whose module draws too, and takes a second to load
_ERROR = "bodycam: error: "
_LOOKED_AT = 20_000  # [bytes] of the end of a log


@dataclass(frozen=True)
class RecordingResult:
    """The result.

    Attributes:
        recording: whose it is.
        figures: of the evaluation; empty without one.
        report: folder of the evaluation.
        seconds: that its own jobs took, without those it shares [s]; None if not known.
        failed: the first step on its way that is not done; None if all are.
        reason: what that step said last; empty if it was never tried.
    """

    recording: Recording
    figures: Mapping[str, Any]
    report: Path
    seconds: float | None
    failed: Step | None
    reason: str

    @property
    def verdict(self) -> str:
        """Good, doubtful or wrong; "failed", "not done" or "unreadable" if there is none."""
        if self.failed is not None:
            return "failed" if self.reason else "not done"
        return str(self.figures.get("verdict", {}).get("level", "unreadable"))

    @property
    def registered(self) -> float | None:
        """The share of images that were registered, of all cameras; None if there are none."""
        cameras = self.figures.get("cameras", {}).values()
        images = sum(camera["images"] for camera in cameras)
        return sum(camera["images"] * camera["registered"] for camera in cameras) / images if images else None

    def figure(self, *keys: str) -> float | None:
        """A number of the evaluation; None if it has none there."""
        value: Any = self.figures if self.failed is None else {}
        for key in keys:
            value = value.get(key) if isinstance(value, Mapping) else None
        return float(value) if isinstance(value, int | float) else None


def results_of(study: Study, folder: WorkflowFolder, steps: StudySteps) -> list[RecordingResult]:
    """The results of all recordings, as they lie in the folder now."""
    return [_result(recording, study, folder, steps) for recording in study.recordings]


def failure_of(folder: WorkflowFolder, step: Step) -> str:
    """What a step said last that explains why it failed; empty if it was never begun."""
    try:
        with folder.log_of(step).open("rb") as file:
            file.seek(max(0, file.seek(0, 2) - _LOOKED_AT))
            said = file.read().decode("utf-8", "replace")
    except OSError:
        return ""
    _, error, message = said.rpartition(_ERROR)
    lines = [line.strip() for line in (message if error else said).splitlines() if line.strip()]
    if not lines:
        return "it was killed before it could say why" if not said.strip() else ""
    return " ".join(lines) if error else lines[-1]


def _result(recording: Recording, study: Study, folder: WorkflowFolder, steps: StudySteps) -> RecordingResult:
    way = steps.way_to(recording, study.subjects[recording.subject])
    own: Sequence[Step] = steps.of_recordings[recording.name]
    failed = next((step for step in way if not step.output.exists()), None)
    report = next(step.output for step in own if step.stage == "evaluate")
    times = [folder.seconds_of(step) for step in own]
    seconds = sum(time for time in times if time is not None) if failed is None else None
    reason = failure_of(folder, failed) if failed is not None else ""
    return RecordingResult(recording, _read(report / _FIGURES), report, seconds, failed, reason)


def _read(path: Path) -> Mapping[str, Any]:
    try:
        figures = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return {}
    return figures if isinstance(figures, dict) else {}


@dataclass(frozen=True)
class StudyColumn:
    """A column of numbers.

    Attributes:
        heading: for people, with the unit.
        key: in the CSV, with the unit.
        of: its value; None if it is not known.
        decimals: that people are shown.
        factor: of what people are shown.
    """

    heading: str
    key: str
    of: Callable[[RecordingResult], float | None]
    decimals: int
    factor: float = 1.0

    def cell(self, result: RecordingResult) -> str:
        """As people are shown it; empty if it is not known."""
        value = self.of(result)
        return number(None if value is None else self.factor * value, self.decimals)


def _figure(*ways: tuple[str, ...]) -> Callable[[RecordingResult], float | None]:
    """The first of some numbers that an evaluation has."""

    def of(result: RecordingResult) -> float | None:
        return next((value for keys in ways if (value := result.figure(*keys)) is not None), None)

    return of


def _registered(result: RecordingResult) -> float | None:
    return result.registered if result.failed is None else None


COLUMNS: Sequence[StudyColumn] = (
    StudyColumn("duration [s]", "duration_s", _figure(("duration_s",)), 1),
    StudyColumn("registered [%]", "registered", _registered, 1, 100.0),
    StudyColumn(
        "joints off [cm]",
        "position_error_cm",
        _figure(("truth", "position_cm", "mean"), ("agreement", "position_cm", "mean")),
        2,
    ),
    StudyColumn(
        "angles off [deg]",
        "angle_error_deg",
        _figure(("truth", "angle_deg", "mean"), ("agreement", "angle_deg", "mean")),
        2,
    ),
    StudyColumn("feet slide [mm]", "sliding_mm", _figure(("sliding", "all", "mean_mm")), 1),
    StudyColumn("speed [m/s]", "speed_m_s", _figure(("gait", "speed_m_s", "mean")), 2),
    StudyColumn("cadence [1/min]", "cadence_per_min", _figure(("gait", "cadence_per_min", "mean")), 1),
    StudyColumn("took [s]", "took_s", lambda result: result.seconds, 0),
)


def shown_columns(results: Sequence[RecordingResult]) -> list[StudyColumn]:
    """Those of which something is known."""
    return [column for column in COLUMNS if any(column.of(result) is not None for result in results)]


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
    from bodycam_ros.evaluate.report_folder import html, markdown  # loads what draws, for its colours

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
