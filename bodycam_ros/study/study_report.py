"""The table over all recordings of a study, as a page and as CSV."""

import csv
import io
import json
from collections import Counter
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from bodycam_ros.evaluate.sections import Columns, Link, Section, column_table, find_figure, render_page
from bodycam_ros.files.whole_file import whole_files
from bodycam_ros.study.engine import StepEnd
from bodycam_ros.study.step_graph import StepGraph
from bodycam_ros.study.study import Recording, Study

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


def read_results(study: Study, graph: StepGraph, failures: Mapping[str, StepEnd]) -> list[RecordingResult]:
    """The results of all recordings.

    Args:
        failures: name of a step -> how it failed.
    """
    results = []
    for recording in study.recordings:
        own = [step for step in graph.steps if step.recording == recording.name]
        report = next(step.output for step in own if step.stage == "evaluate")
        failure = next((failures[step.name] for step in own if step.name in failures), None)
        figures: dict[str, Any] = {}
        if failure is None:
            with suppress(OSError, ValueError):
                figures = dict(json.loads((report / _FIGURES).read_text(encoding="utf-8")))
            cameras = figures.get("cameras", {}).values()
            if images := sum(camera["images"] for camera in cameras):
                figures["registered"] = sum(camera["images"] * camera["registered"] for camera in cameras) / images
            figures["took_s"] = sum(graph.seconds(step) or 0.0 for step in own)
        results.append(RecordingResult(recording, figures, report, failure))
    return results


_FIGURES_OF: Mapping[str, tuple[str, ...]] = {
    "duration_s": ("duration_s",),
    "registered": ("registered",),
    "position_error_cm": ("truth.position_cm.mean", "agreement.position_cm.mean"),
    "angle_error_deg": ("truth.angle_deg.mean", "agreement.angle_deg.mean"),
    "sliding_mm": ("sliding.all.mean_mm",),
    "speed_m_s": ("gait.speed_m_s.mean",),
    "cadence_per_min": ("gait.cadence_per_min.mean",),
    "took_s": ("took_s",),
}
"""Column of the CSV, with the unit -> places of its value in the figures, of which the first that exists is taken."""

_COLUMNS: Columns = (
    ("subject", "subject", ""), ("place", "place", ""), ("verdict", "verdict", ""),
    ("duration [s]", "duration_s", ".1f"), ("registered", "registered", ".1%"),
    ("position error [cm]", "position_error_cm", ".2f"), ("angle error [deg]", "angle_error_deg", ".2f"),
    ("foot sliding [mm]", "sliding_mm", ".1f"), ("speed [m/s]", "speed_m_s", ".2f"),
    ("cadence [1/min]", "cadence_per_min", ".1f"), ("took [s]", "took_s", ".0f"),
)  # fmt: skip


def write_study_report(title: str, results: Sequence[RecordingResult], folder: Path) -> None:
    """Write page and CSV; earlier ones are replaced.

    Args:
        folder: of the study's results.

    Raises:
        OutputError: they cannot be written.
    """
    rows: dict[str, dict[str, Any]] = {}
    for result in results:
        of = result.recording
        row: dict[str, Any] = {
            "recording": of.name,
            "subject": of.subject,
            "place": of.place,
            "verdict": result.verdict,
        }
        for name, places in _FIGURES_OF.items():
            found = (find_figure(result.figures, place) for place in places)
            row[name] = next((float(value) for value in found if isinstance(value, int | float)), None)
        end = result.failure
        row["report"] = result.report.relative_to(folder).as_posix() if end is None else ""
        row |= {"failed_step": end and end.step.name, "reason": end and end.failure}
        rows[of.name] = row
    table = column_table("", "recording", _COLUMNS, rows).table
    assert table is not None
    links = [Link(name, f"{row['report']}/{_REPORT}") if row["report"] else name for name, row in rows.items()]
    linked = [(link, *cells[1:]) for link, cells in zip(links, table.rows, strict=True)]
    failures = {name: row for name, row in rows.items() if row["reason"]}
    failed = column_table("Failed", "recording", (("step", "failed_step", ""), ("reason", "reason", "")), failures)
    sections = [Section(table=replace(table, rows=linked)), *([failed] if failures else [])]
    text = io.StringIO()
    lines = csv.DictWriter(text, next(iter(rows.values()), {}), lineterminator="\n")
    lines.writeheader()
    lines.writerows({k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows.values())
    with whole_files(folder, inside=True) as unfinished:
        page = render_page(title, [f"{count_verdicts(results)}."], sections)
        (unfinished / PAGE).write_text(page, encoding="utf-8")
        (unfinished / CSV).write_text(text.getvalue(), encoding="utf-8")


def count_verdicts(results: Sequence[RecordingResult]) -> str:
    """How many recordings have which verdict, in words."""
    counts = Counter(result.verdict for result in results)
    what = "recording" if len(results) == 1 else "recordings"
    return f"{len(results)} {what}: {', '.join(f'{counts[word]} {word}' for word in _VERDICTS if counts[word])}"
