"""What is said on /diagnostics of a run: how each camera fares lately, and the verdict on what is solved."""

from collections import Counter, defaultdict
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import IntEnum

import numpy as np

from bodycam_ros.body.equipment_report import EquipmentReport
from bodycam_ros.camera.readout import Readout
from bodycam_ros.messages.factory import MAP_FRAME, Message, MessageFactory, flat, header_message, numbers
from bodycam_ros.registration.landmark_matches import CameraSight, LandmarkMatches, camera_sight
from bodycam_ros.registration.readout_time import DOUBTFUL_S, TypicalSpeed, doubt
from bodycam_ros.timing.clock_state import ClockHistory, ClockState
from bodycam_ros.verdict import Level, Verdict

_NAMED = 3


class HealthLevel(IntEnum):
    """Levels of diagnostic_msgs/DiagnosticStatus."""

    OK = 0
    WARN = 1
    ERROR = 2
    STALE = 3


@dataclass(frozen=True)
class Health:
    """The health of one part, such as a camera.

    Attributes:
        name: the part ("camera head"); a node puts its own name before it.
        level: how it is.
        text: why, in one line.
        values: figures that say it in detail.
    """

    name: str
    level: HealthLevel
    text: str
    values: Mapping[str, object] = field(default_factory=dict)


def diagnostics_message(make: MessageFactory, stamp_ns: int, parts: Sequence[Health], computer: str = "") -> Message:
    """diagnostic_msgs/DiagnosticArray; ``computer`` is where the parts are, if that is worth telling."""
    statuses = [
        make(
            "diagnostic_msgs/msg/DiagnosticStatus",
            level=make.byte(int(part.level)),
            name=part.name,
            hardware_id=computer,
            message=part.text,
            values=[
                make("diagnostic_msgs/msg/KeyValue", key=key, value=str(value)) for key, value in part.values.items()
            ],
        )
        for part in parts
    ]
    return make("diagnostic_msgs/msg/DiagnosticArray", header=header_message(make, stamp_ns, ""), status=statuses)


def few(names: Sequence[str]) -> str:
    """The first of some names, and how many more there are, so that a line stays a line."""
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(names[:_NAMED]) + more


def text_message(make: MessageFactory, text: str) -> Message:
    """std_msgs/String, such as a URDF."""
    return make("std_msgs/msg/String", data=text)


_POOR_SHARE = 0.9
"""A camera registered on a smaller share of its frames gets a warning: the body still holds, but with less."""

_APART_S = 5.0
"""No machine is so busy: the camera's clock is another."""

_LEVELS = {Level.GOOD: HealthLevel.OK, Level.DOUBTFUL: HealthLevel.WARN, Level.WRONG: HealthLevel.ERROR}


@dataclass
class _Tally:
    frames: int = 0
    landmarks: int = 0
    sights: Counter[CameraSight] = field(default_factory=Counter)
    sigma_mm: float = float("nan")
    readout: Readout | None = None

    @property
    def registered(self) -> int:
        """Images with a pose."""
        return self.sights[CameraSight.REGISTERED] + self.sights[CameraSight.RELATIVE]


class RegistrationHealth:
    """Counts registrations between two reports.

    Args:
        cameras: the cameras that should be heard; a silent one is reported too.
    """

    def __init__(self, cameras: Iterable[str]) -> None:
        self._tallies = {camera: _Tally() for camera in cameras}
        self._speeds: defaultdict[str, TypicalSpeed] = defaultdict(TypicalSpeed)

    def add(self, matches: LandmarkMatches) -> None:
        """Count one image's registration."""
        tally = self._tallies.setdefault(matches.camera, _Tally())
        tally.frames += 1
        tally.landmarks += len(matches.landmark_ids)
        tally.sights[camera_sight(matches)] += 1
        tally.readout = matches.readout
        self._speeds[matches.camera].add(matches)
        if matches.world_T_camera is not None:
            tally.sigma_mm = 1e3 * float(np.sqrt(np.trace(matches.pose_covariance[3:, 3:])))

    def report(self, clocks: Mapping[str, ClockState] | None = None) -> list[Health]:
        """The health of every camera since the last report, which starts the count anew.

        Args:
            clocks: of the cameras, as far as they are known.
        """
        parts = [
            self._health(camera, tally, (clocks or {}).get(camera)) for camera, tally in sorted(self._tallies.items())
        ]
        self._tallies = {camera: _Tally() for camera in self._tallies}
        return parts

    def _health(self, camera: str, tally: _Tally, clock: ClockState | None) -> Health:
        health = _health(camera, tally, clock)
        if tally.readout is None:
            return health
        values = {**health.values, "read-out time [ms]": tally.readout.milliseconds}
        if tally.readout.sigma > DOUBTFUL_S:
            values["read-out time"] = doubt(tally.readout, self._speeds[camera])
        return replace(health, values=values)


def _health(camera: str, tally: _Tally, clock: ClockState | None) -> Health:
    name = f"camera {camera}"
    if tally.frames == 0:
        return Health(name, HealthLevel.STALE, "no images")
    share = tally.registered / tally.frames
    values: dict[str, object] = {
        "frames": tally.frames,
        "registered": tally.registered,
        **{f"{sight.label} [%]": round(100 * tally.sights[sight] / tally.frames) for sight in CameraSight},
        "landmarks per frame": round(tally.landmarks / tally.frames, 1),
        "position sigma [mm]": round(tally.sigma_mm, 2),
    }
    if clock is not None:
        values |= clock_values(clock)
    if tally.registered == 0:
        return Health(name, HealthLevel.ERROR, "not registered in the map", values)
    level = HealthLevel.OK if share >= _POOR_SHARE else HealthLevel.WARN
    return Health(name, level, f"registered on {share:.0%} of its frames", values)


def clock_values(clock: ClockState) -> dict[str, object]:
    """Figures of a camera's clock."""
    return {
        "clock ahead by [ms]": round(1e3 * clock.offset, 2),
        "clock sigma [ms]": round(1e3 * clock.offset_sigma, 2),
        "clock drift [ppm]": round(1e6 * clock.drift, 1),
        "clock drift sigma [ppm]": round(1e6 * clock.drift_sigma, 1),
    }


def timing_health(
    camera: str,
    share: float,
    missed: int,
    late: int,
    silent: bool,
    apart_s: float | None,
    timing: ClockHistory | None,
) -> Health:
    """How one camera goes with the others.

    Args:
        camera: its name.
        share: share of the body's instants that it speaks of, 0 to 1.
        missed: instants of which it did not speak, but half of all cameras did.
        late: registrations that came after their instant had gone.
        silent: whether it is not waited for any more.
        apart_s: how far its stamps are ahead of the body's present, or behind if negative [s]; None if it says nothing.
        timing: what is known of its clock; None while nothing is.
    """
    values: dict[str, object] = {
        "share of instants [%]": round(100 * share),
        "instants missed": missed,
        "late registrations": late,
    }
    level, text = HealthLevel.OK, "in time with the others"
    if timing is not None:
        values |= clock_values(timing.latest)
        if timing.is_off:
            text = f"its clock is {_off_by(timing.latest.offset)} the others', and corrected"
    if apart_s is not None and abs(apart_s) > _APART_S:
        side = "ahead of" if apart_s > 0 else "behind"
        level, text = HealthLevel.ERROR, f"its stamps are {abs(apart_s):.1f} s {side} the others'; it is left out"
    elif silent:
        level, text = HealthLevel.ERROR, "says nothing, and is not waited for"
    elif share < _POOR_SHARE:
        level, text = HealthLevel.WARN, "misses instants"
    return Health(f"camera {camera}", level, f"{text}; speaks of {share:.0%} of the instants", values)


def _off_by(offset_s: float) -> str:
    return f"{1e3 * abs(offset_s):.1f} ms {'ahead of' if offset_s > 0 else 'behind'}"


def equipment_health(report: EquipmentReport) -> Health:
    """How the body is coupled to its equipment at an instant."""
    if not report.placed:
        return Health(f"equipment {report.name}", HealthLevel.WARN, "it is not known where it is; nothing holds to it")
    held, let_go = (
        [name for name, holds in zip(report.attachments, report.engaged, strict=True) if holds == wanted]
        for wanted in (True, False)
    )
    text = f"held: {few(held) or 'nothing'}" + (f"; let go: {few(let_go)}" if let_go else "")
    values: dict[str, object] = {
        f"{name} [mm]": round(1e3 * float(apart), 1)
        for name, apart in zip(report.attachments, report.deviations, strict=True)
    }
    for name, value, sigma in zip(report.lengths, report.values, report.sigmas, strict=True):
        values[f"length {name} [mm]"] = f"{1e3 * value:.1f} +- {1e3 * sigma:.1f}"
    return Health(f"equipment {report.name}", HealthLevel.OK if held else HealthLevel.WARN, text, values)


def verdict_health(verdict: Verdict) -> Health:
    """Whether the result may be used, and what each camera has to do with it."""
    told: dict[str, list[str]] = {}
    for finding in verdict.findings:
        told.setdefault(finding.subject, []).append(finding.description)
    values = {camera: "; ".join(lines) for camera, lines in told.items()}
    return Health("verdict", _LEVELS[verdict.level], verdict.text, values)


EQUIPMENT, EQUIPMENT_TYPE = "/equipment", "bodycam_msgs/msg/EquipmentState"


def equipment_message(make: MessageFactory, stamp_ns: int, report: EquipmentReport) -> Message:
    """bodycam_msgs/EquipmentState of one instant."""
    return make(
        EQUIPMENT_TYPE,
        header=header_message(make, stamp_ns, MAP_FRAME),
        name=report.name,
        placed=report.placed,
        attachments=list(report.attachments),
        engaged=make.sequence(flat(report.engaged, np.uint8)),
        deviations=make.sequence(flat(report.deviations, np.float64)),
        lengths=list(report.lengths),
        priors=make.sequence(flat(report.priors, np.float64)),
        values=make.sequence(flat(report.values, np.float64)),
        sigmas=make.sequence(flat(report.sigmas, np.float64)),
    )


def equipment_report(message: Message) -> EquipmentReport:
    """What a bodycam_msgs/EquipmentState says.

    Raises:
        ValueError: its arrays do not have one value for each name.
    """
    attachments, lengths = tuple(message.attachments), tuple(message.lengths)
    return EquipmentReport(
        name=message.name,
        placed=bool(message.placed),
        attachments=attachments,
        engaged=numbers(message.engaged, np.uint8, len(attachments)).astype(bool),
        deviations=numbers(message.deviations, np.float64, len(attachments)),
        lengths=lengths,
        priors=numbers(message.priors, np.float64, len(lengths)),
        values=numbers(message.values, np.float64, len(lengths)),
        sigmas=numbers(message.sigmas, np.float64, len(lengths)),
    )
