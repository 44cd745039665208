"""How far the sound of a clap has to go to a camera: 3 ms a metre.

Where claps are made is not known: by a clapper board in somebody's hands, as in A, or by the wearer's own. The first
reaches all cameras within the 2 to 3 ms that a body is long, and in what order nothing tells. If the wearer clapped,
ordinary proportions tell the larger part, and what is left is people's size and bearing.
"""

from collections.abc import Mapping

from bodycam_ros.ingest.clock_fit import SOUND_SPEED

WAYS_M: Mapping[str, float] = {
    "hand": 0.1,
    "forearm": 0.25,
    "upper_arm": 0.45,
    "torso": 0.4,
    "head": 0.5,
    "pelvis": 0.45,
    "thigh": 0.65,
    "shin": 1.05,
    "foot": 1.35,
}
"""From hands that clap before the chest of a person of 1.75 m to the middle of each segment [m], by kind of segment."""

OWN_CLAP_SIGMA_M = 0.12
"""What is left of the way once it is corrected: size, bearing, and on which side the camera is [m]."""


def travel_s(cameras: Mapping[str, str]) -> dict[str, float]:
    """Camera -> nominal time [s] from the wearer's clapping hands, of those whose segment has an ordinary name.

    Args:
        cameras: camera -> segment that it is strapped to.
    """
    return {
        camera: WAYS_M[kind] / SOUND_SPEED for camera, segment in cameras.items() if (kind := _kind(segment)) in WAYS_M
    }


def _kind(segment: str) -> str:
    return segment.removesuffix("_left").removesuffix("_right")
