"""Whether every joint was moved through its range, as far as the sampled instants tell."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.calibration.anatomy import SegmentName
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.doctor.doctor_settings import DoctorSettings
from bodycam_ros.doctor.finding import Finding, Light
from bodycam_ros.doctor.registered_samples import RegisteredSamples
from bodycam_ros.geometry import Array, log_so3, nearest_rotation

_CHECK = "exercise"
_FEWEST = 6  # instants, of which a range can be told
_HARDLY = 0.25  # of what a joint should turn by, which is red


def check_exercise(registered: RegisteredSamples, rig: Rig, settings: DoctorSettings) -> Iterator[Finding]:
    """Say which joints of a range of motion turned too little, or about one axis only."""
    told = 0
    for segment in rig.segments:
        parent = rig.parents[segment]
        if parent is None:
            continue
        named = SegmentName(segment)
        of, turns = f"joint {named.joint}", _turns(registered, rig, parent, segment)
        if len(turns) < _FEWEST:
            what = f"cameras on both sides are registered together in {len(turns)} of the sampled images"
            yield Finding(_CHECK, Light.AMBER, what, "so nobody can tell how far it was moved", of)
            continue
        told += 1
        far, second = _ranges_deg(turns)
        seen = f"turned by {far:.0f} deg, about a second axis by {second:.0f}, in {len(turns)} instants"
        if far < settings.exercise:
            light = Light.RED if far < _HARDLY * settings.exercise else Light.AMBER
            yield Finding(_CHECK, light, seen, named.exercise, of)
        elif second < settings.second_axis and not named.straight_in_rest:
            yield Finding(_CHECK, Light.AMBER, seen, named.exercise, of)
    if told:
        yield Finding(
            _CHECK, Light.GREEN, f"{told} joints could be judged by the sampled images; between them more may be"
        )


def _turns(registered: RegisteredSamples, rig: Rig, parent: str, segment: str) -> Array:
    """(K, 3, 3) rotations of a segment's camera in its parent's, of the pair that is seen together most often."""
    best: list[Array] = []
    for above in rig.cameras_on(parent):
        for below in rig.cameras_on(segment):
            first, second = registered.known(above), registered.known(below)
            both = [first[n][:3, :3].T @ second[n][:3, :3] for n in sorted(first.keys() & second.keys())]
            best = both if len(both) > len(best) else best
    return np.array(best).reshape(-1, 3, 3)


def _ranges_deg(turns: Array) -> tuple[float, float]:
    """How far rotations (K, 3, 3) go about their main axis and the one across it [deg]."""
    middle = nearest_rotation(turns.mean(axis=0))
    vectors = np.degrees(log_so3(middle.T @ turns))
    axes = np.linalg.svd(vectors - vectors.mean(axis=0), full_matrices=False)[2]
    ranges = np.sort(np.ptp(vectors @ axes.T, axis=0))[::-1]
    return float(ranges[0]), float(ranges[1])
