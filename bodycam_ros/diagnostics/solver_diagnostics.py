"""Diagnostics of the solver: rates, latency, missing cameras, equipment."""

import time
from collections import Counter, deque
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.body_state import BodyState
from bodycam_ros.diagnostics.camera_diagnostics import LOW_SHARE, clock_values
from bodycam_ros.diagnostics.dropped_messages import DroppedMessages
from bodycam_ros.estimation.solver_counts import SolverCounts
from bodycam_ros.files.shown import few
from bodycam_ros.messages.diagnostics import Status, StatusLevel

if TYPE_CHECKING:
    from bodycam_ros.pipeline.skeleton import SkeletonPipeline

_ARRIVALS = 1000
_JUMP_NS = 1_000_000_000
_APART_S = 5.0
"""Largest delay of a busy machine; stamps farther apart are of another clock."""

_PATIENCE_S = 2.0
"""No registration for so long is an error, and so are registrations without a solved frame."""


@dataclass
class _Tally:
    """Counts since the last report."""

    received: int = 0
    registered: set[str] = field(default_factory=set)
    solved: int = 0
    predicted: int = 0
    cameras_used: int = 0
    latency_s: float = 0.0


class SolverDiagnostics:
    """Counts registrations and solved frames between two reports.

    Args:
        dropped: messages that could not be used.
        body_cameras: whether cameras on the body are used, or static ones alone.
    """

    def __init__(self, dropped: DroppedMessages, body_cameras: bool) -> None:
        self._dropped, self._what = dropped, "registrations" if body_cameras else "images"
        self._found = "is registered in the map" if body_cameras else "observes the body"
        self._tally = _Tally()
        self._late_reported = 0
        self._rejected_reported: Counter[str] = Counter()
        self._received_s = self._started_s = self._solved_s = 0.0
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=_ARRIVALS)
        self._contradictory_reported = 0
        self._image_ns: dict[str, int] = {}
        self._image_s: dict[str, float] = {}
        self._latest_ns: dict[str, int] = {}

    @property
    def quiet_s(self) -> float:
        """Time since the last registration [s]."""
        return time.monotonic() - self._received_s

    def add_image(self, camera: str, stamp_ns: int) -> None:
        """Note that a camera has taken an image, whose registration is still to come."""
        self._image_ns[camera], self._image_s[camera] = stamp_ns, time.monotonic()

    def add_registration(self, camera: str, stamp_ns: int, is_registered: bool) -> None:
        """Count a registration, or an image of a static camera."""
        self._tally.received += 1
        self._latest_ns[camera] = stamp_ns
        if is_registered:
            self._tally.registered.add(camera)
        now_s = time.monotonic()
        if now_s - self._received_s > _PATIENCE_S:
            self._started_s = now_s
        self._received_s = now_s
        if self._arrivals and stamp_ns < self._arrivals[-1][0] - _JUMP_NS:
            self._arrivals.clear()
        if not self._arrivals or stamp_ns > self._arrivals[-1][0]:
            self._arrivals.append((stamp_ns, now_s))

    def add_state(self, state: BodyState) -> None:
        """Count a published state."""
        self._solved_s = arrived_s = time.monotonic()
        self._tally.solved += 1
        self._tally.predicted += state.predicted
        self._tally.cameras_used += state.cameras_used
        while self._arrivals and self._arrivals[0][0] <= state.stamp_ns:
            arrived_s = self._arrivals.popleft()[1]
        self._tally.latency_s += self._solved_s - arrived_s

    def report(self, pipeline: "SkeletonPipeline | None") -> list[Status]:
        """Status of the body and of each camera since the last report.

        Args:
            pipeline: solves; None while there is no body.
        """
        tally, self._tally = self._tally, _Tally()
        dropped = self._dropped
        late = pipeline.arrivals.late if pipeline else 0
        lost, self._late_reported = dropped.count_new() + max(0, late - self._late_reported), late
        counts = pipeline.counts if pipeline else SolverCounts()
        contradictory = counts.contradictory - self._contradictory_reported
        self._contradictory_reported = counts.contradictory
        rejected = counts.rejected
        rejections, self._rejected_reported = rejected - self._rejected_reported, rejected.copy()
        values: dict[str, object] = {
            "registrations per second": tally.received,
            "frames per second": tally.solved,
            "frames predicted": tally.predicted,
            "latency [ms]": round(1e3 * tally.latency_s / tally.solved) if tally.solved else "none",
            "cameras used per frame": round(tally.cameras_used / max(1, tally.solved), 1),
            "late registrations": late,
            "registrations rejected": ", ".join(f"{c} {n}" for c, n in sorted(rejections.items())) or "none",
            **solver_status(counts).values,
            "restarts": pipeline.arrivals.epoch if pipeline else 0,
            **dropped.values,
        }
        level, text = self._judge(tally, lost, sorted(rejections), contradictory > 0, pipeline)
        cameras = _camera_statuses(pipeline, self._what, self._late_s)
        return [Status("body", level, text, values), *_sensor_status(pipeline), *cameras]

    @property
    def _late_s(self) -> dict[str, float]:
        """Camera -> time from the image that was registered last to the one that was taken last [s]."""
        now_s = time.monotonic()
        # Drivers that publish a camera_info once, and not with each image, give it an old stamp.
        recent = {camera for camera, arrived_s in self._image_s.items() if now_s - arrived_s < _PATIENCE_S}
        both = recent & self._latest_ns.keys()
        return {camera: 1e-9 * (self._image_ns[camera] - self._latest_ns[camera]) for camera in both}

    def _judge(
        self,
        tally: _Tally,
        lost: int,
        rejected: Sequence[str],
        are_contradictory: bool,
        pipeline: "SkeletonPipeline | None",
    ) -> tuple[StatusLevel, str]:
        """Level and text.

        Args:
            tally: since the last report.
            lost: messages that were.
            rejected: cameras.
            are_contradictory: whether frames were left out at the start, in which cameras contradict each other.
            pipeline: None if there is no body.
        """
        what, found = self._what, self._found
        if self.quiet_s > _PATIENCE_S:
            return StatusLevel.ERROR, f"no {what} arrive"
        if pipeline is None:
            return StatusLevel.OK, "no body yet"
        nobody = f"no camera {found}"
        if registered := sorted(tally.registered):
            nobody = f"{few(registered)} can be used, but " + (
                "they contradict each other" if rejected or are_contradictory else "no state is complete yet"
            )
        if tally.solved == 0 and self._received_s - max(self._solved_s, self._started_s) > _PATIENCE_S:
            return StatusLevel.ERROR, f"{what} arrive, but {nobody}: no state is solved"
        if tally.solved and tally.predicted == tally.solved:
            return StatusLevel.ERROR, f"{nobody}; the body is predicted"
        if silent := pipeline.arrivals.silent:
            return StatusLevel.WARN, f"solving without {few(silent)}: no {what}"
        if rejected:
            return StatusLevel.WARN, f"solving without {few(rejected)}: rejected, they contradict the other cameras"
        if tally.predicted or lost:
            return StatusLevel.WARN, "solving, with losses"
        return StatusLevel.OK, "solving"


def solver_status(counts: SolverCounts) -> Status:
    """Counts of a whole recording."""
    values: dict[str, object] = {
        "frames interpolated": counts.interpolated,
        "frames not converged": counts.unconverged,
        "contradictory frames at the start": counts.contradictory,
        "windows restarted": counts.restarted,
    }
    remarks = counts.remarks()
    return Status("solver", StatusLevel.WARN if remarks else StatusLevel.OK, "; ".join(remarks) or "solved", values)


def _sensor_status(pipeline: "SkeletonPipeline | None") -> list[Status]:
    """State of the inertial sensors; none of a body without."""
    if pipeline is None or not pipeline.inertial.biases:
        return []
    faults, in_use = pipeline.inertial.faults(), pipeline.inertial.in_use
    values: dict[str, object] = {"in use": ", ".join(in_use) or "none", **faults}
    text = f"{len(in_use)} of {len(pipeline.inertial.biases)} in use"
    if faults:
        text = f"sensors with faults, see the values: {few([*faults])}"
    return [Status("inertial sensors", StatusLevel.WARN if faults else StatusLevel.OK, text, values)]


def _camera_statuses(pipeline: "SkeletonPipeline | None", what: str, late_s: Mapping[str, float]) -> list[Status]:
    """Agreement in time of each camera with the others.

    Args:
        pipeline: solves; None while there is no body.
        what: they send.
        late_s: camera -> how long its latest image was taken after that of its latest registration, as far as its
            driver publishes a camera_info with each image [s].
    """
    if pipeline is None:
        return []
    clocks = pipeline.clocks.histories
    statuses = []
    for camera, own in pipeline.arrivals.cameras().items():
        values: dict[str, object] = {
            "share of frames [%]": round(100 * own.share),
            "late registrations": own.late,
        }
        level, text = StatusLevel.OK, "in time with the others"
        if (clock := clocks.get(camera)) is not None:
            values |= clock_values(clock.latest)
            if clock.is_off:
                text = f"clock offset {1e3 * clock.latest.offset:+z.1f} ms, corrected"
        if (apart_s := own.apart_s) is not None and abs(apart_s) > _APART_S:
            side = "ahead of" if apart_s > 0 else "behind"
            text = f"its stamps are {abs(apart_s):.1f} s {side} the others'; it is not used"
            if -apart_s < 2.0 * late_s.get(camera, 0.0):
                text = f"its {what} are {abs(apart_s):.1f} s late: its tracker or registration does not keep up"
            level = StatusLevel.ERROR
        elif own.is_silent:
            level, text = StatusLevel.ERROR, f"no {what}; the solver does not wait for it"
        elif own.share < LOW_SHARE:
            level, text = StatusLevel.WARN, f"{what} are missing"
        statuses.append(Status(f"camera {camera}", level, f"{text}; in {own.share:.0%} of the body's frames", values))
    return statuses


def equipment_status(report: EquipmentReport) -> Status:
    """Couplings of the body to its equipment in one frame."""
    name = f"equipment {report.name}"
    if not report.placed:
        return Status(name, StatusLevel.WARN, "its pose is unknown; no coupling is active")
    active, released = (
        [name for name, engaged in zip(report.attachments, report.engaged, strict=True) if engaged == wanted]
        for wanted in (True, False)
    )
    text = f"active: {few(active) or 'none'}" + (f"; released: {few(released)}" if released else "")
    values: dict[str, object] = {
        f"{name} [mm]": round(1e3 * float(apart), 1) + 0.0
        for name, apart in zip(report.attachments, report.deviations, strict=True)
    }
    for length, value, sigma in zip(report.lengths, report.values, report.sigmas, strict=True):
        values[f"length {length} [mm]"] = f"{1e3 * value:.1f} +- {1e3 * sigma:.1f}"
    return Status(name, StatusLevel.OK if active else StatusLevel.WARN, text, values)
