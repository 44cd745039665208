"""What came of one recording of a study: the figures of its evaluation, or which step failed and why."""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bodycam_ros.study.study import Recording, Study
from bodycam_ros.study.study_steps import StudySteps
from bodycam_ros.study.workflow_folder import WorkflowFolder
from bodycam_ros.workflow.step import Step

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
