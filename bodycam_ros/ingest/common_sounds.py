"""Peaks of several cameras that are one sound, once it is known where the cameras lie in time."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.ingest.arrival import arrivals
from bodycam_ros.ingest.clap_places import clusters, peak_weight
from bodycam_ros.ingest.clock_fit import HeardSounds
from bodycam_ros.ingest.sound_peaks import CameraSound, SoundPeak
from bodycam_ros.ingest.sound_settings import ClapSettings

Array = NDArray[np.float64]

_ROUGH_SIGMA_S = 2e-3  # of a peak by its time alone


@dataclass(frozen=True, eq=False)
class SoundGroup:
    """Peaks of several cameras that are one sound: number of the camera -> its peak; worth; share that heard it."""

    members: Mapping[int, SoundPeak]
    weight: float
    share: float
    about_s: float


def common_sounds(
    sounds: Sequence[CameraSound], shifts: Array, drifts: Array, settings: ClapSettings
) -> list[SoundGroup]:
    """Sounds that two cameras or more heard, by all their peaks."""
    entries = [
        (shifts[camera] + (1.0 + drifts[camera]) * peak.media_s, camera, peak)
        for camera, sound in enumerate(sounds)
        for peak in sound.peaks
    ]
    entries.sort(key=lambda entry: entry[0])
    times = np.array([entry[0] for entry in entries])
    owners = np.array([entry[1] for entry in entries])
    starts = shifts + (1.0 + drifts) * np.array([sound.start_s for sound in sounds])
    ends = shifts + (1.0 + drifts) * np.array([sound.end_s for sound in sounds])
    groups = []
    for group in clusters(times, owners, settings.tolerance):
        if len(group) < 2:
            continue
        about = float(times[group].mean())
        listening = max(len(group), int(((about > starts) & (about < ends)).sum()))
        members = {int(owners[number]): entries[number][2] for number in group}
        weight = sum(peak_weight(peak) for peak in members.values()) / listening
        groups.append(SoundGroup(members, weight, len(group) / listening, about))
    return groups


def worthiest(groups: Sequence[SoundGroup], settings: ClapSettings) -> list[SoundGroup]:
    """The sounds that clocks are fitted to: the worthiest, and of those before and after half time as many."""
    if not groups:
        return []
    half_time = 0.5 * (groups[0].about_s + groups[-1].about_s)
    chosen: list[SoundGroup] = []
    for side in (True, False):
        there = [group for group in groups if (group.about_s <= half_time) == side]
        chosen += sorted(there, key=lambda group: -group.weight)[: settings.most_sounds // 2]
    floor = 0.1 * max(group.weight for group in chosen)
    return sorted((group for group in chosen if group.weight >= floor), key=lambda group: group.about_s)


def heard_sounds(groups: Sequence[SoundGroup], exact: bool) -> HeardSounds:
    """When each was heard; ``exact``: by the waveforms, which takes longer."""
    sound, camera, media, sigma = [], [], [], []
    for number, group in enumerate(groups):
        peaks = list(group.members.values())
        times, sigmas = (
            arrivals(peaks) if exact else (np.array([p.media_s for p in peaks]), np.full(len(peaks), _ROUGH_SIGMA_S))
        )
        sound += [number] * len(peaks)
        camera += list(group.members)
        media += list(times)
        sigma += list(sigmas)
    return HeardSounds(np.array(sound), np.array(camera), np.array(media), np.array(sigma))
