"""Which sounds all cameras heard, the claps among them, and what they say of the cameras' clocks (A section 3).

A sound that all cameras heard counts, be it a clap or the bounce of a ball; claps are the loudest of them.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.clap_places import Listener, places_of
from bodycam_ros.ingest.offset_agreement import Clocks, HeardSounds, fit_clocks
from bodycam_ros.ingest.sound_peaks import CameraSound, SoundPeak
from bodycam_ros.ingest.sound_settings import ClapSettings, ClockSettings
from bodycam_ros.ingest.whole_sound import SoundGroup, common_sounds, heard_sounds, worthiest

_LOOKS = 3  # places, then clocks, then exact arrivals: each look groups peaks by what the one before found


@dataclass(frozen=True, eq=False)
class CommonSound:
    """A sound that two cameras or more heard.

    Attributes:
        recording_s: when it was heard by the reference, or would have been by the fit [s].
        heard_s: camera -> media time at which it heard it [s].
        late_s: camera -> by how much later it heard it than the fit says: travel, and error [s].
        peaks: camera -> its peak.
        share: of the cameras that ran, which heard it.
        clap: whether it is a clap, or as loud as one.
    """

    recording_s: float
    heard_s: Mapping[str, float]
    late_s: Mapping[str, float]
    peaks: Mapping[str, SoundPeak]
    share: float
    clap: bool

    def in_time_of(self, camera: CameraTime) -> "CommonSound":
        """The same sound in the time of another camera, of which the clock in the present time is given."""
        return replace(self, recording_s=(self.recording_s - camera.start_s) / (1.0 + camera.drift))


@dataclass(frozen=True, eq=False)
class ClapResult:
    """What claps say; cameras that they cannot place are not in it.

    Attributes:
        reference: whose time the others' are in; empty if claps say nothing.
        times: camera -> its clock.
        confidence: camera -> 0 to 1, the lead over the second best way to lay it upon the others.
        sounds: in order of time.
    """

    reference: str = ""
    times: Mapping[str, CameraTime] = field(default_factory=dict)
    confidence: Mapping[str, float] = field(default_factory=dict)
    sounds: tuple[CommonSound, ...] = ()


def find_claps(heard: Mapping[str, CameraSound], settings: ClapSettings, clock_settings: ClockSettings) -> ClapResult:
    """Lay the cameras' sudden sounds upon each other and fit the clocks."""
    places = places_of({name: Listener(sound, settings) for name, sound in heard.items() if sound.peaks}, settings)
    names = [name for name in heard if name in places]
    shifts = np.array([places[name].shift for name in names])
    drifts = np.array([places[name].drift for name in names])
    for look in range(_LOOKS):
        groups = worthiest(common_sounds([heard[name] for name in names], shifts, drifts, settings), settings)
        if not groups:
            return ClapResult()
        table = heard_sounds(groups, exact=look == _LOOKS - 1)
        reference = _reference(names, table, clock_settings)
        joined = _joined_to(reference, table, len(names))
        if not joined.all():
            # What met in the search met by chance: the rest does better without that camera.
            rest = {name: heard[name] for name, there in zip(names, joined, strict=True) if there}
            return find_claps(rest, settings, clock_settings)
        clocks = fit_clocks(table, reference, shifts, clock_settings)
        shifts, drifts = clocks.starts, clocks.drifts
    times = {
        name: CameraTime(
            name,
            float(clocks.starts[number]),
            float(clocks.drifts[number]),
            float(clocks.start_sigmas[number]),
            float(clocks.drift_sigmas[number]),
            "claps",
        )
        for number, name in enumerate(names)
    }
    confidence = {name: places[name].confidence for name in names}
    return ClapResult(names[reference], times, confidence, _sounds(groups, table, clocks, names, settings))


def _reference(names: Sequence[str], table: HeardSounds, settings: ClockSettings) -> int:
    if settings.reference in names:
        return list(names).index(settings.reference)
    return int(np.argmax(np.bincount(table.camera, minlength=len(names))))


def _joined_to(reference: int, table: HeardSounds, cameras: int) -> NDArray[np.bool_]:
    """Which cameras (C,) share sounds with the reference, if only through others."""
    joined: NDArray[np.bool_] = np.equal(np.arange(cameras), reference)
    while True:
        sounds = np.unique(table.sound[joined[table.camera]])
        wider = joined.copy()
        wider[table.camera[np.isin(table.sound, sounds)]] = True
        if (wider == joined).all():
            return joined
        joined = wider


def _sounds(
    groups: Sequence[SoundGroup], table: HeardSounds, clocks: Clocks, names: Sequence[str], settings: ClapSettings
) -> tuple[CommonSound, ...]:
    loudness = _loudness(groups)
    sounds = []
    for number, group in enumerate(groups):
        rows = np.flatnonzero(table.sound == number)
        cameras = [names[camera] for camera in table.camera[rows]]
        sounds.append(
            CommonSound(
                float(clocks.sounds_s[number]),
                dict(zip(cameras, table.media_s[rows].tolist(), strict=True)),
                dict(zip(cameras, clocks.residuals_s[rows].tolist(), strict=True)),
                {names[camera]: peak for camera, peak in group.members.items()},
                group.share,
                group.share >= settings.min_share and loudness[number] >= settings.min_loudness * max(loudness),
            )
        )
    return tuple(sounds)


def _loudness(groups: Sequence[SoundGroup]) -> list[float]:
    """How loud each sound is, whatever the gain of those that heard it: the median of its share of their loudest."""
    loudest: dict[int, float] = {}
    for group in groups:
        for camera, peak in group.members.items():
            loudest[camera] = max(loudest.get(camera, 0.0), peak.amplitude)
    return [
        float(np.median([peak.amplitude / max(loudest[camera], 1e-9) for camera, peak in group.members.items()]))
        for group in groups
    ]
