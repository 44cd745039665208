"""How the solver says how it fares: rates, latency, what is missing, and how the cameras go together."""

import time
from collections import Counter, deque
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from bodycam_ros.body_state import BodyState
from bodycam_ros.camera import CameraModel
from bodycam_ros.live.flow_of_frames import Skipped
from bodycam_ros.messages.health import Health, HealthLevel, few, timing_health
from bodycam_ros.pipeline import SkeletonPipeline
from bodycam_ros.robot.retargeting import RobotState

_ARRIVALS = 1000
_JUMP_NS = 1_000_000_000
_PATIENCE_S = 2.0
"""No registration for so long is an error, and so are registrations without an instant solved."""


class KnownCameras(Protocol):
    """What is known of the cameras; see ``CameraModels``."""

    models: dict[str, CameraModel]
    refused: set[str]
    changes: int

    @property
    def missing(self) -> list[str]:
        """Cameras without camera_info so far."""


@dataclass
class _Tally:
    """What happened since the last report."""

    heard: int = 0
    solved: int = 0
    predicted: int = 0
    cameras_used: int = 0
    latency_s: float = 0.0


class SolverHealth:
    """Counts what the solver hears and publishes between two reports.

    Args:
        cameras: what is known of the cameras.
        skipped: what could not be used.
    """

    def __init__(self, cameras: KnownCameras, skipped: Skipped) -> None:
        self._cameras = cameras
        self._skipped = skipped
        self._tally = _Tally()
        self._late_reported = 0
        self._refused_reported: Counter[str] = Counter()
        self._heard_s = self._begun_s = self._solved_s = 0.0
        self._arrivals: deque[tuple[int, float]] = deque(maxlen=_ARRIVALS)

    @property
    def quiet_s(self) -> float:
        """How long no registration has come."""
        return time.monotonic() - self._heard_s

    def heard(self, stamp_ns: int) -> None:
        """A registration has come."""
        self._tally.heard += 1
        now_s = time.monotonic()
        if now_s - self._heard_s > _PATIENCE_S:
            self._begun_s = now_s
        self._heard_s = now_s
        if self._arrivals and stamp_ns < self._arrivals[-1][0] - _JUMP_NS:
            self._arrivals.clear()
        if not self._arrivals or stamp_ns > self._arrivals[-1][0]:
            self._arrivals.append((stamp_ns, now_s))

    def solved(self, state: BodyState) -> None:
        """An instant is published."""
        self._solved_s = arrived_s = time.monotonic()
        self._tally.solved += 1
        self._tally.predicted += state.predicted
        self._tally.cameras_used += state.cameras_used
        while self._arrivals and self._arrivals[0][0] <= state.stamp_ns:
            arrived_s = self._arrivals.popleft()[1]
        self._tally.latency_s += self._solved_s - arrived_s

    def report(self, pipeline: SkeletonPipeline | None, has_body: bool) -> list[Health]:
        """The health of body and cameras since the last report.

        Args:
            pipeline: that solves; None while there is none.
            has_body: whether there is a body to solve.
        """
        tally, self._tally = self._tally, _Tally()
        cameras, skipped = self._cameras, self._skipped
        late = pipeline.assembler.late if pipeline else 0
        lost, self._late_reported = skipped.lately() + max(0, late - self._late_reported), late
        refused = pipeline.refused if pipeline else Counter()
        refusals = refused - self._refused_reported
        self._refused_reported = refused.copy()
        values: dict[str, object] = {
            "registrations per second": tally.heard,
            "instants per second": tally.solved,
            "instants predicted": tally.predicted,
            "latency [ms]": round(1e3 * tally.latency_s / tally.solved) if tally.solved else "none",
            "cameras used per instant": round(tally.cameras_used / max(1, tally.solved), 1),
            "cameras known": len(cameras.models),
            "cameras missing": ", ".join([*cameras.missing, *sorted(cameras.refused)]) or "none",
            "camera_info changed": cameras.changes,
            "late registrations": late,
            "registrations not believed": ", ".join(f"{c} {n}" for c, n in sorted(refusals.items())) or "none",
            "instants bridged": pipeline.bridged if pipeline else 0,
            "times begun anew": pipeline.assembler.restarts if pipeline else 0,
            **skipped.counts,
            "last error": skipped.latest or "none",
        }
        level, text = self._judge(tally, lost, sorted(refusals), has_body, is_solving=pipeline is not None)
        return [Health("body", level, text, values), *self._of_cameras(pipeline)]

    def _judge(
        self, tally: _Tally, lost: int, refused: Sequence[str], has_body: bool, is_solving: bool
    ) -> tuple[HealthLevel, str]:
        lacking = few([*self._cameras.missing, *sorted(self._cameras.refused)])
        if self.quiet_s > _PATIENCE_S:
            too = f", and no usable camera_info of {lacking}" if lacking else ""
            return HealthLevel.ERROR, f"no registration comes{too}"
        if not is_solving and not has_body:
            return HealthLevel.OK, "no body yet"
        if not is_solving:
            return HealthLevel.ERROR, f"registrations, but no usable camera_info of {lacking}"
        if tally.solved == 0 and self._heard_s - max(self._solved_s, self._begun_s) > _PATIENCE_S:
            return HealthLevel.ERROR, "registrations come, but no camera is registered in the map"
        if tally.solved and tally.predicted == tally.solved:
            return HealthLevel.ERROR, "no camera is registered; the body is a guess"
        if lacking:
            return HealthLevel.WARN, f"solving without {lacking}: no usable camera_info"
        if refused:
            return HealthLevel.WARN, f"solving without {few(refused)}: what they say contradicts the other cameras"
        if tally.predicted or lost:
            return HealthLevel.WARN, "solving, with losses"
        return HealthLevel.OK, "solving"

    def _of_cameras(self, pipeline: SkeletonPipeline | None) -> list[Health]:
        """How each camera goes with the others."""
        if pipeline is None:
            return []
        assembler, timings = pipeline.assembler, pipeline.synchronizer.clocks.histories
        silent = assembler.silent
        return [
            timing_health(
                camera,
                share,
                assembler.synchrony.missed[camera],
                assembler.late_of[camera],
                camera in silent,
                assembler.apart_s(camera),
                timings.get(camera),
            )
            for camera, share in assembler.synchrony.shares().items()
        ]


class RobotHealth:
    """Counts what a robot does between two reports.

    Args:
        skipped: instants and bodies that it could not follow.
    """

    def __init__(self, skipped: Skipped) -> None:
        self._skipped = skipped
        self._forget()

    def _forget(self) -> None:
        self._instants = self._held = 0
        self._farthest_m = 0.0

    def add(self, state: RobotState) -> None:
        """The robot has followed an instant."""
        self._instants += 1
        self._held += state.blocked
        self._farthest_m = max(self._farthest_m, *state.errors_m.values())

    def report(self, has_body: bool) -> Health:
        """The health since the last report; ``has_body``: whether there is one that it can follow."""
        instants, held = self._instants, self._held
        values: dict[str, object] = {
            "instants per second": instants,
            "farthest hand or foot [cm]": round(100.0 * self._farthest_m, 1),
            "instants held by limits": held,
            **self._skipped.counts,
        }
        self._forget()
        skipped = self._skipped.lately()
        if not instants:
            text = self._skipped.latest if skipped or not has_body else ""
            return Health("robot", HealthLevel.WARN, text or "nothing to follow: no body is solved", values)
        level, text = (HealthLevel.WARN, "its limits hold it back") if held else (HealthLevel.OK, "follows")
        return Health("robot", level, text, values)
