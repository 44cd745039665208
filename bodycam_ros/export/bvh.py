"""BVH: a hierarchy of bones and, frame by frame, the place of the root and three angles a bone.

Each bone has the order of angles whose middle one is about its length, which nobody's joint turns by 90 degrees, and
the root that whose first is about the vertical, about which people turn for ever; so angles neither jump nor swing near
the singularity of Euler's angles. Every reader has to go by the channels that a bone says. A gap, which BVH cannot
show, is crossed straight. Lengths are metres unless ``--scale`` says otherwise, and y is up unless ``--up`` does.
"""

import numpy as np

from bodycam_ros.export.figure import Figure
from bodycam_ros.export.options import MotionOptions
from bodycam_ros.export.sampled_motion import SampledMotion
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.euler_angles import EulerOrder

MARK = "HIERARCHY"

_PLACES = "Xposition Yposition Zposition"
_UP, _ALONG_ROOT = "y", {"y": "yzx", "z": "zyx"}
"""Axis that is up -> the root's order: about the vertical, then sideways, then forward."""

_ALONG_BONE = {"x": "yxz", "y": "xyz", "z": "xzy"}
"""Axis along a bone -> its order of angles."""


def bvh(motion: SampledMotion, options: MotionOptions) -> str:
    """The motion as a BVH document.

    Raises:
        BodyError: two bones would have the same name.
    """
    figure = Figure.of(motion, options, _UP)
    orders = _orders(figure, options.up or _UP)
    lines = [MARK, *_bone(figure, orders, 0, 0)]
    assert motion.rate is not None  # of a format that is even
    lines += ["MOTION", f"Frames: {len(motion.stamps_ns)}", f"Frame Time: {1.0 / motion.rate:.9f}"]
    degrees = np.degrees(_angles(figure, orders))
    order = _depth_first(figure, 0)
    numbers = np.concatenate([figure.places[:, 0], degrees[:, order].reshape(len(degrees), -1)], axis=1)
    lines += [" ".join(map("{:.6f}".format, row)) for row in numbers.tolist()]
    return "\n".join(lines) + "\n"


def _orders(figure: Figure, up: str) -> tuple[str, ...]:
    def along(row: int) -> str:
        longest = max(figure.ends_of(row), key=lambda end: float(np.linalg.norm(end)))
        return "xyz"[int(np.abs(longest).argmax())]

    return (_ALONG_ROOT[up], *(_ALONG_BONE[along(row)] for row in range(1, len(figure.names))))


def _angles(figure: Figure, orders: tuple[str, ...]) -> Array:
    """(T, N, 3) intrinsic angles in the order of each bone, each nearest to those of the frame before [rad]."""
    euler = EulerOrder(orders)
    angles = np.empty((*figure.local_turns.shape[:2], 3))
    previous = np.zeros((len(orders), 3))
    for frame, turns in enumerate(figure.local_turns):
        previous = angles[frame] = euler.decompose(turns, previous)
    return angles


def _bone(figure: Figure, orders: tuple[str, ...], row: int, level: int) -> list[str]:
    rotations = " ".join(f"{axis.upper()}rotation" for axis in orders[row])
    channels = f"6 {_PLACES} {rotations}" if row == 0 else f"3 {rotations}"
    lines = [
        f"{'ROOT' if row == 0 else 'JOINT'} {figure.names[row]}",
        "{",
        f"\tOFFSET {_numbers(figure.offsets[row])}",
        f"\tCHANNELS {channels}",
    ]
    lines = ["\t" * level + line for line in lines]
    for child in _children(figure, row):
        lines += _bone(figure, orders, child, level + 1)
    if row in figure.tips:
        inside = ["\tEnd Site", "\t{", f"\t\tOFFSET {_numbers(figure.tips[row])}", "\t}"]
        lines += ["\t" * level + line for line in inside]
    return [*lines, "\t" * level + "}"]


def _depth_first(figure: Figure, row: int) -> list[int]:
    """Rows in the order in which they stand in the document."""
    return [row, *(below for child in _children(figure, row) for below in _depth_first(figure, child))]


def _children(figure: Figure, row: int) -> list[int]:
    return [child for child, parent in enumerate(figure.parents) if parent == row]


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.6f}" for value in values.tolist())
