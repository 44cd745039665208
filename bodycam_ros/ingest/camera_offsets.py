"""Each camera's start and drift: by claps, else by the sound as a whole, else by whoever else can tell.

Other sources (the motion of cameras, a GoPro's telemetry, a file's time of creation) are callables, asked in turn: for
cameras that nobody has placed yet, and for their opinion about those that somebody has.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from threading import Event
from typing import Protocol

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.claps import CommonSound, find_claps
from bodycam_ros.ingest.frame_stream import for_each_camera
from bodycam_ros.ingest.offset_agreement import SOUND_SPEED
from bodycam_ros.ingest.sound_peaks import OWN_CLAP_SIGMA_M, CameraSound, scan_sound, travel_s
from bodycam_ros.ingest.sound_settings import SoundSettings
from bodycam_ros.ingest.whole_sound import compare_sounds
from bodycam_ros.recording.sound import SoundBlock, SoundSource

_SIGMAS = 4.0


def gap_s(one: CameraTime, other: CameraTime, at_media_s: float) -> tuple[float, float]:
    """(by how much the other says later, its standard deviation) at a media time, all in seconds."""
    gap = other.start_s - one.start_s + (other.drift - one.drift) * at_media_s
    variances = [t.start_sigma_s**2 + (t.drift_sigma * at_media_s) ** 2 for t in (one, other)]
    return gap, float(np.sqrt(sum(variances)))


def agree(one: CameraTime, other: CameraTime, at_media_s: float) -> bool:
    """Whether two clocks of one camera may both be true."""
    gap, sigma = gap_s(one, other, at_media_s)
    return abs(gap) <= _SIGMAS * sigma


def combined(one: CameraTime, other: CameraTime) -> CameraTime:
    """What both say together, each by its information; the source is that of the surer start."""
    start_s, start_sigma_s = _mean(one.start_s, one.start_sigma_s, other.start_s, other.start_sigma_s)
    drift, drift_sigma = _mean(one.drift, one.drift_sigma, other.drift, other.drift_sigma)
    surer = min(one, other, key=lambda time: time.start_sigma_s)
    return CameraTime(one.camera, start_s, drift, start_sigma_s, drift_sigma, surer.source)


def in_time_of(times: Mapping[str, CameraTime], known: Mapping[str, CameraTime]) -> dict[str, CameraTime]:
    """Clocks of a source with a time of its own, shifted and stretched to the time of those already known.

    Without a camera in common they stay as they are. ``recording = shift + (1 + rate) * own`` is taken from the
    reference, of which nothing is uncertain, or else from the middle of the cameras in common.
    """
    common = [name for name in times if name in known]
    if not common:
        return dict(times)
    common = [name for name in common if known[name].start_sigma_s == 0.0] or common
    rate = float(np.median([known[name].drift - times[name].drift for name in common]))
    moved = {
        name: replace(time, start_s=(1.0 + rate) * time.start_s, drift=time.drift + rate)
        for name, time in times.items()
    }
    shift = float(np.median([known[name].start_s - moved[name].start_s for name in common]))
    return {name: replace(time, start_s=time.start_s + shift) for name, time in moved.items()}


def relative_to(reference: str, times: Mapping[str, CameraTime]) -> dict[str, CameraTime]:
    """The same clocks in the time of another camera, which gets start 0, drift 0 and no uncertainty.

    That of the others grows by the reference's own; what both have in common is counted twice.
    """
    zero = times[reference]
    if zero.start_s == zero.drift == zero.start_sigma_s == zero.drift_sigma == 0.0:
        return dict(times)
    moved = {
        name: CameraTime(
            name,
            (time.start_s - zero.start_s) / (1.0 + zero.drift),
            (1.0 + time.drift) / (1.0 + zero.drift) - 1.0,
            float(np.hypot(time.start_sigma_s, zero.start_sigma_s)),
            float(np.hypot(time.drift_sigma, zero.drift_sigma)),
            time.source,
        )
        for name, time in times.items()
    }
    return moved | {reference: CameraTime(reference, 0.0, 0.0, 0.0, 0.0, zero.source)}


def _mean(one: float, one_sigma: float, other: float, other_sigma: float) -> tuple[float, float]:
    if min(one_sigma, other_sigma) <= 0.0:
        return (one, one_sigma) if one_sigma <= other_sigma else (other, other_sigma)
    weights = one_sigma**-2.0, other_sigma**-2.0
    return (weights[0] * one + weights[1] * other) / sum(weights), sum(weights) ** -0.5


_MOST_NAMED = 4

_ROUGH_S = 0.05
"""The motion of the body finds the rest of a clock that is off by no more."""


class TimeSource(Protocol):
    """Somebody else who can tell cameras' clocks."""

    name: str
    """As ``CameraTime.source`` has it."""

    confidence: Mapping[str, float]
    """After a call: camera -> 0 to 1, see ``Offsets``; 0 of one that is not in it."""

    remarks: Sequence[str]
    """After a call: what a person should know."""

    def __call__(self, known: Mapping[str, CameraTime]) -> Mapping[str, CameraTime]:
        """Clocks of the cameras that it can tell, in the time of those known, or in one of its own if none is.

        Args:
            known: what was found before, as a first guess; cameras that are not in it have none.
        """
        ...


Progress = Callable[[str, int, int], None]
"""Told what is being done, how much of it is done, and of how much."""


@dataclass(frozen=True, eq=False)
class Offsets:
    """The clocks of all cameras.

    Attributes:
        reference: camera whose media time is the recording's.
        times: camera -> its clock, in the order in which they were given.
        confidence: camera -> 0 to 1: how far ahead the chosen way to place it is of the second best;
            1 if two sources agree.
        sounds: that several cameras heard, in order of time, the claps among them.
        heard: camera -> what was kept of its sound.
        unplaced: camera that nobody can place -> why; it is in neither ``times`` nor ``confidence``.
        remarks: what a person should know, a line each; the camera's name comes first.
    """

    reference: str
    times: Mapping[str, CameraTime]
    confidence: Mapping[str, float]
    sounds: tuple[CommonSound, ...] = ()
    heard: Mapping[str, CameraSound] = field(default_factory=dict)
    unplaced: Mapping[str, str] = field(default_factory=dict)
    remarks: tuple[str, ...] = ()

    @property
    def claps(self) -> tuple[CommonSound, ...]:
        """The claps, in order of time."""
        return tuple(sound for sound in self.sounds if sound.clap)


def camera_times(
    sounds: Mapping[str, SoundSource],
    segments: Mapping[str, str] | None = None,
    others: Sequence[TimeSource] = (),
    settings: SoundSettings | None = None,
    on_progress: Progress = lambda what, done, of: None,
) -> Offsets:
    """Find the clocks of all cameras.

    Args:
        sounds: camera -> its sound, opened once; no block at all is a camera without sound.
        segments: camera -> segment that it is strapped to, if that is known.
        others: asked after the sound, in this order.
        settings: of all steps.
        on_progress: told how far it is, from the calling thread.

    Raises:
        RecordingError: nobody can place two cameras; the message says of each why, and what to do.
    """
    settings = settings or SoundSettings()
    if len(sounds) == 1:
        only = next(iter(sounds))
        return Offsets(only, {only: CameraTime(only, 0.0, 0.0, 0.0, 0.0, "given")}, {only: 1.0})
    heard, remarks = _scan(sounds, settings, on_progress)
    remarks += [f"{name}: {fault}" for name, sound in heard.items() if (fault := _deaf(sound))]
    settings = _with_reference(settings, segments, heard)

    on_progress("looking for claps", 0, 1)
    claps = find_claps(heard, settings.claps, settings.clocks)
    on_progress("looking for claps", 1, 1)
    times, confidence = dict(claps.times), dict(claps.confidence)
    if segments and settings.clocks.wearer_claps:
        times = _without_travel(times, claps.reference, travel_s(segments))

    whole = compare_sounds(
        heard,
        times,
        settings.whole_sound,
        settings.clocks,
        lambda done, of: on_progress("comparing sounds", done, of),
    )
    remarks += [f"{name}: no clap fits, placed by its sound as a whole" for name in whole.times if times]
    times |= whole.times
    confidence |= whole.confidence
    if not claps.times and whole.times:
        remarks.append("no clap was found; cameras are placed by their sound as a whole")

    for other in others:
        _ask(other, times, confidence, heard, remarks)
    placed = [name for name in sounds if name in times]
    unplaced = {name: _why_not(heard[name], placed, others) for name in sounds if name not in times}
    if len(placed) < 2:
        raise RecordingError(nobody_knows({name: _why_not(heard[name], (), others) for name in sounds}))
    reference = next((name for name in placed if times[name].start_sigma_s == 0.0), placed[0])
    if settings.clocks.reference in placed:
        reference = settings.clocks.reference
    elif settings.clocks.reference:
        remarks.append(f"{settings.clocks.reference}: cannot be the reference, it is not placed; {reference} is")
    zero = times[reference]
    return Offsets(
        reference,
        relative_to(reference, {name: times[name] for name in placed}),
        {name: confidence[name] for name in placed},
        tuple(sound.in_time_of(zero) for sound in claps.sounds),
        heard,
        unplaced,
        tuple(remarks + _doubts(placed, times, confidence, claps.sounds)),
    )


def _scan(
    sounds: Mapping[str, SoundSource], settings: SoundSettings, on_progress: Progress
) -> tuple[dict[str, CameraSound], list[str]]:
    """Listen to all cameras, as many at once as there are cores; of a sound that breaks off, what was heard counts."""
    faults: dict[str, str] = {}

    def scan(name: str, ended: Event) -> CameraSound:
        return scan_sound(blocks(name, ended), settings.sound_peaks)

    def blocks(name: str, ended: Event) -> Iterator[SoundBlock]:
        try:
            for block in sounds[name]():
                if ended.is_set():
                    return
                yield block
        except RecordingError as error:
            faults[name] = str(error)

    heard = for_each_camera(sounds, scan, lambda done, of: on_progress("listening", done, of))
    return heard, [f"{name}: {faults[name]}" for name in sounds if name in faults]


def _deaf(sound: CameraSound) -> str:
    """Why a camera's sound tells nothing; empty if it may."""
    if sound.duration_s <= 0.0:
        return "has no sound"
    return "its sound is silence" if sound.loudest <= 0.0 else ""


def _with_reference(
    settings: SoundSettings, segments: Mapping[str, str] | None, heard: Mapping[str, CameraSound]
) -> SoundSettings:
    """The reference is a camera in the middle of the body, if one is known: claps reach it with the mean delay."""
    wanted = settings.clocks.reference
    if wanted:
        if wanted not in heard:
            raise RecordingError(
                f"clocks.reference: there is no camera '{wanted}' in the recording; there are {', '.join(heard)}"
            )
        return settings
    middle = next((n for n in heard if segments and segments.get(n) == "pelvis" and not _deaf(heard[n])), "")
    return replace(settings, clocks=replace(settings.clocks, reference=middle))


def _without_travel(
    times: Mapping[str, CameraTime], reference: str, travel: Mapping[str, float]
) -> dict[str, CameraTime]:
    """Clocks from the wearer's own claps, without the nominal travel to each camera."""
    if reference not in travel:
        return dict(times)
    ways_s = np.sqrt(2.0) * OWN_CLAP_SIGMA_M / SOUND_SPEED
    return {
        name: time
        if name == reference or name not in travel
        else replace(
            time,
            start_s=time.start_s + travel[name] - travel[reference],
            start_sigma_s=min(time.start_sigma_s, float(np.hypot(ways_s, 1e-4))),
        )
        for name, time in times.items()
    }


def _ask(
    source: TimeSource,
    times: dict[str, CameraTime],
    confidence: dict[str, float],
    heard: Mapping[str, CameraSound],
    remarks: list[str],
) -> None:
    """Let another source place who is not placed, and refine or contradict who is."""
    told = in_time_of(source(dict(times)), times)
    remarks += source.remarks
    for name, time in told.items():
        if name not in heard:
            continue
        if name not in times:
            times[name], confidence[name] = time, source.confidence.get(name, 0.0)
            within = f"to {time.start_sigma_s:.1g} s only: record a clap" if time.start_sigma_s > _ROUGH_S else ""
            remarks.append(f"{name}: sound does not tell when it started, {source.name} does {within}".strip())
            continue
        middle_s = 0.5 * (heard[name].start_s + heard[name].end_s)
        if agree(times[name], time, middle_s):
            times[name], confidence[name] = combined(times[name], time), 1.0
            continue
        gap, sigma = gap_s(times[name], time, middle_s)
        remarks.append(
            f"{name}: {source.name} differs from {times[name].source} by {1e3 * gap:+.1f} ms, "
            f"{abs(gap) / sigma:.0f} sigmas, and is left out"
        )


def _doubts(
    names: Sequence[str],
    times: Mapping[str, CameraTime],
    confidence: Mapping[str, float],
    sounds: Sequence[CommonSound],
) -> list[str]:
    doubts = [
        f"{n}: another start fits nearly as well (confidence {confidence[n]:.2f})"
        for n in names
        if confidence[n] < 0.3 and times[n].start_sigma_s <= _ROUGH_S
    ]
    claps = [sound for sound in sounds if sound.clap]
    for name in names:
        if times[name].source == "claps" and claps:
            unheard = [f"{clap.recording_s:.2f} s" for clap in claps if name not in clap.heard_s]
            if unheard:
                doubts.append(f"{name}: does not have the clap at {', '.join(unheard[:_MOST_NAMED])}")
    return doubts


def _why_not(sound: CameraSound, placed: Sequence[str], others: Sequence[TimeSource]) -> str:
    whose = f"that of {placed[0]}" if placed else "another camera's"
    reason = _deaf(sound) or f"its sound has too little in common with {whose}, or fits at several times alike"
    asked = f"; {' and '.join(other.name for other in others)} cannot tell either" if others else ""
    return reason + asked


def nobody_knows(unplaced: Mapping[str, str]) -> str:
    """A message about cameras that nobody can place (camera -> why), and what to do."""
    named = "; ".join(f"{name}: {why}" for name, why in list(unplaced.items())[:_MOST_NAMED])
    more = f"; and {len(unplaced) - _MOST_NAMED} more" if len(unplaced) > _MOST_NAMED else ""
    return (
        f"when these cameras started cannot be told. {named}{more}. Clap loudly once all cameras run and again "
        "before the first is stopped, or leave out the files that have no sound"
    )
