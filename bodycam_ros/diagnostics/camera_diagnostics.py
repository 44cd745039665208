"""Diagnostics of the live graph and of a replay alike: registration of the cameras, and the verdict on the result."""

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from statistics import median

from bodycam_ros.camera.readout import Readout
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.registration.landmark_matches import CameraSight, LandmarkMatches, camera_sight
from bodycam_ros.registration.readout_time import DOUBTFUL_S, doubt
from bodycam_ros.results.verdict import Level, Verdict
from bodycam_ros.timing.clock_state import ClockState

LOW_SHARE = 0.9
"""A camera registered in a smaller share of its frames gets a warning."""

FEW_IMAGES = 0.4
"""A camera with fewer than this share of the other cameras' images, or of its own before, gets a warning; cameras of 30
and 60 Hz may be used together."""

_LEVELS = {Level.GOOD: StatusLevel.OK, Level.DOUBTFUL: StatusLevel.WARN, Level.WRONG: StatusLevel.ERROR}


@dataclass
class _Tally:
    frames: int = 0
    landmarks: int = 0
    sights: Counter[CameraSight] = field(default_factory=Counter)
    sigma_mm: float = float("nan")
    readout: Readout | None = None


class RegistrationDiagnostics:
    """Counts the registrations of each camera between two reports.

    Args:
        cameras: names; those without frames are reported too.
    """

    def __init__(self, cameras: Iterable[str]) -> None:
        self._tallies = {camera: _Tally() for camera in cameras}

    def add(self, matches: LandmarkMatches) -> None:
        """Count one frame."""
        tally = self._tallies.setdefault(matches.camera, _Tally())
        tally.frames += 1
        tally.landmarks += len(matches.landmark_ids)
        tally.sights[camera_sight(matches)] += 1
        tally.readout = matches.readout
        if matches.world_T_camera is not None:
            tally.sigma_mm = 1e3 * matches.position_sigma

    def report(self, clocks: Mapping[str, ClockState] | None = None) -> list[Status]:
        """Status of every camera since the last report.

        Args:
            clocks: of the cameras whose clocks are known.
        """
        tallies, self._tallies = self._tallies, {camera: _Tally() for camera in self._tallies}
        usual = median(tally.frames for tally in tallies.values()) if tallies else 0.0
        return [self._status(camera, tallies[camera], usual, (clocks or {}).get(camera)) for camera in sorted(tallies)]

    def _status(self, camera: str, tally: _Tally, usual: float, clock: ClockState | None) -> Status:
        """Status of a camera, where ``usual`` is the median of the cameras' numbers of frames."""
        name, frames = f"camera {camera}", tally.frames
        if frames == 0:
            return Status(name, StatusLevel.ERROR, "no images")
        registered = tally.sights[CameraSight.REGISTERED] + tally.sights[CameraSight.RELATIVE]
        values: dict[str, object] = {
            "frames": frames,
            "registered": registered,
            **{f"{sight.label} [%]": round(100 * tally.sights[sight] / frames) for sight in CameraSight},
            "landmarks per frame": round(tally.landmarks / frames, 1),
            "position sigma [mm]": round(tally.sigma_mm, 2),
        }
        if clock is not None:
            values |= clock_values(clock)
        if tally.readout is not None:
            values["read-out time [ms]"] = tally.readout.milliseconds
            if tally.readout.sigma > DOUBTFUL_S:
                values["read-out time"] = doubt(tally.readout)
        if registered == 0:
            return Status(name, StatusLevel.ERROR, "not registered in the map", values)
        share, text = registered / frames, f"registered on {registered / frames:.0%} of its frames"
        if frames < FEW_IMAGES * usual:
            return Status(name, StatusLevel.WARN, f"{text}, but has {frames} where others have {usual:g}", values)
        return Status(name, StatusLevel.OK if share >= LOW_SHARE else StatusLevel.WARN, text, values)


def clock_values(clock: ClockState) -> dict[str, object]:
    """Figures of a clock."""
    return {
        "clock offset [ms]": round(1e3 * clock.offset, 2) + 0.0,
        "clock offset sigma [ms]": round(1e3 * clock.offset_sigma, 2),
        "clock drift [ppm]": round(1e6 * clock.drift, 1) + 0.0,
        "clock drift sigma [ppm]": round(1e6 * clock.drift_sigma, 1),
    }


def verdict_status(verdict: Verdict) -> Status:
    """Verdict on the result, with the findings of each camera as values."""
    by_subject: dict[str, list[str]] = {}
    for finding in verdict.findings:
        by_subject.setdefault(finding.subject, []).append(finding.description)
    values = {subject: "; ".join(lines) for subject, lines in by_subject.items()}
    return Status("verdict", _LEVELS[verdict.level], verdict.text, values)
