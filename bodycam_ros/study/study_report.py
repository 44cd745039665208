"""The table over all recordings of a study, as a page and as CSV."""

import csv
import io
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bodycam_ros.evaluate.page import render_page
from bodycam_ros.evaluate.sections import Link, Page, Section, Table, find_figure
from bodycam_ros.study.done_steps import DoneSteps
from bodycam_ros.study.step_runner import StepEnd
from bodycam_ros.study.study import Recording, Step, Study
from bodycam_ros.whole_file import whole_files

PAGE, CSV = "study.html", "study.csv"
_FIGURES, _REPORT = "summary.json", "report.html"  # of an evaluation, whose modules take a second to load
_VERDICTS = ("good", "doubtful", "wrong", "failed", "unreadable")


@dataclass(frozen=True)
class RecordingResult:
    """The result of a recording.

    Attributes:
        figures: of the evaluation, with ``took_s`` of its own steps and ``registered``, the share of images of all
            cameras; empty if a step failed.
        report: folder of the evaluation.
        failure: its first step that failed, or was not run; None if all are done.
    """

    recording: Recording
    figures: Mapping[str, Any]
    report: Path
    failure: StepEnd | None

    @property
    def verdict(self) -> str:
        """Good, doubtful or wrong; "failed" or "unreadable" without an evaluation."""
        if self.failure is not None:
            return "failed"
        return str(self.figures.get("verdict", {}).get("level", "unreadable"))

    @property
    def names(self) -> tuple[str, str, str, str]:
        """Of recording, subject, place and verdict."""
        return self.recording.name, self.recording.subject, self.recording.place, self.verdict


def read_results(
    study: Study, steps: Sequence[Step], notes: DoneSteps, failures: Mapping[str, StepEnd]
) -> list[RecordingResult]:
    """The results of all recordings.

    Args:
        failures: name of a step -> how it failed.
    """
    results = []
    for recording in study.recordings:
        own = [step for step in steps if step.name.startswith(f"{recording.name}: ")]
        report = next(step.output for step in own if step.stage == "evaluate")
        failure = next((failures[step.name] for step in own if step.name in failures), None)
        figures: dict[str, Any] = {}
        if failure is None:
            with suppress(OSError, ValueError):
                figures = dict(json.loads((report / _FIGURES).read_text(encoding="utf-8")))
            cameras = figures.get("cameras", {}).values()
            if images := sum(camera["images"] for camera in cameras):
                figures["registered"] = sum(camera["images"] * camera["registered"] for camera in cameras) / images
            figures["took_s"] = sum(notes.seconds(step) or 0.0 for step in own)
        results.append(RecordingResult(recording, figures, report, failure))
    return results


@dataclass(frozen=True)
class StudyColumn:
    """A column of numbers.

    Attributes:
        heading: with the unit.
        key: in the CSV, with the unit.
        places: of its value in the figures, as "truth.angle_deg.mean"; the first that exists is taken.
        decimals: of the heading's unit.
        factor: from the CSV's unit to the heading's.
    """

    heading: str
    key: str
    places: tuple[str, ...]
    decimals: int
    factor: float = 1.0

    def value(self, result: RecordingResult) -> float | None:
        """In the CSV's unit; None if it is unknown."""
        found = (find_figure(result.figures, place) for place in self.places)
        return next((float(value) for value in found if isinstance(value, int | float)), None)

    def cell(self, result: RecordingResult) -> str:
        """In the heading's unit; empty if it is unknown."""
        value = self.value(result)
        return "" if value is None else f"{self.factor * value:.{self.decimals}f}"


_POSITION, _ANGLE = (
    tuple(f"{source}.{what}.mean" for source in ("truth", "agreement")) for what in ("position_cm", "angle_deg")
)
COLUMNS = (
    StudyColumn("duration [s]", "duration_s", ("duration_s",), 1),
    StudyColumn("registered [%]", "registered", ("registered",), 1, 100.0),
    StudyColumn("position error [cm]", "position_error_cm", _POSITION, 2),
    StudyColumn("angle error [deg]", "angle_error_deg", _ANGLE, 2),
    StudyColumn("foot sliding [mm]", "sliding_mm", ("sliding.all.mean_mm",), 1),
    StudyColumn("speed [m/s]", "speed_m_s", ("gait.speed_m_s.mean",), 2),
    StudyColumn("cadence [1/min]", "cadence_per_min", ("gait.cadence_per_min.mean",), 1),
    StudyColumn("took [s]", "took_s", ("took_s",), 0),
)


def known_columns(results: Sequence[RecordingResult]) -> list[StudyColumn]:
    """Those with a value in one of the results."""
    return [column for column in COLUMNS if any(column.value(result) is not None for result in results)]


def write_study_report(title: str, results: Sequence[RecordingResult], folder: Path) -> None:
    """Write page and CSV; earlier ones are replaced.

    Args:
        folder: of the study's results.

    Raises:
        OutputError: they cannot be written.
    """
    columns = known_columns(results)
    headings = ("recording", "subject", "place", "verdict", *(column.heading for column in columns))
    rows: list[tuple[str | Link, ...]] = []
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    keys = [column.key for column in COLUMNS]
    table.writerow(["recording", "subject", "place", "verdict", *keys, "report", "failed_step", "reason"])
    for result in results:
        name, *others = result.names
        values = ["" if value is None else f"{value:.6g}" for value in (column.value(result) for column in COLUMNS)]
        report = result.report.relative_to(folder).as_posix()
        end = result.failure
        last = [report, "", ""] if end is None else ["", end.step.name, end.failure or ""]
        table.writerow([*result.names, *values, *last])
        first = Link(name, f"{report}/{_REPORT}") if end is None else name
        rows.append((first, *others, *(column.cell(result) for column in columns)))
    sections = [Section(table=Table(headings, rows, frozenset(range(4))))]
    failures = [(r.recording.name, r.failure.step.name, r.failure.failure or "") for r in results if r.failure]
    if failures:
        sections.append(Section("Failed", table=Table(("recording", "step", "reason"), failures, frozenset(range(3)))))
    with whole_files(folder) as unfinished:
        page = render_page(Page(title, [f"{count_verdicts(results)}."], sections))
        (unfinished / PAGE).write_text(page, encoding="utf-8")
        (unfinished / CSV).write_text(text.getvalue(), encoding="utf-8")


def count_verdicts(results: Sequence[RecordingResult]) -> str:
    """How many recordings have which verdict, in words."""
    counts = Counter(result.verdict for result in results)
    what = "recording" if len(results) == 1 else "recordings"
    return f"{len(results)} {what}: {', '.join(f'{counts[word]} {word}' for word in _VERDICTS if counts[word])}"
