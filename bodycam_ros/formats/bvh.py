"""BVH: a hierarchy of bones and, frame by frame, the place of the root and three angles a bone.

Each bone has the order of angles whose middle one is about its length, which nobody's joint turns by 90 degrees, and
the root that whose first is about the vertical, about which people turn for ever; so angles neither jump nor swing near
the singularity of Euler's angles. Every reader has to go by the channels that a bone says. A gap, which BVH cannot
show, is crossed straight. Lengths are metres unless ``--scale`` says otherwise, and y is up unless ``--up`` does.
"""

import re
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.formats.captured_motion import Y_UP_TO_Z_UP, CapturedMotion
from bodycam_ros.formats.figure import Figure
from bodycam_ros.formats.motion_text import checked_stamps, read_motion_text
from bodycam_ros.formats.options import MotionOptions
from bodycam_ros.formats.sampled_motion import SampledMotion
from bodycam_ros.geometry import Array, exp_so3
from bodycam_ros.kinematics.joint_angles import EulerOrder
from bodycam_ros.shown import shown

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


_AXES = {"X": 0, "Y": 1, "Z": 2}
_DEEPEST = 200
_WORD = re.compile(r"(ROOT|JOINT)[^\S\n]+([^\n{}]*[^\s{}])|(\S+)")
"""A word of the hierarchy. A name goes to the end of its line: 3ds Max writes ``ROOT Bip01 Pelvis``."""

_MOTION = re.compile(r"^\s*MOTION\b", re.MULTILINE)
"""A line of its own: the word may be part of a name too."""

_MOST_CHANNELS = 6
"""Of a joint: three places, three turns."""


@dataclass(frozen=True, eq=False)
class _Joint:
    name: str
    parent: str | None
    offset: Array
    channels: tuple[str, ...]


def captured_bvh(path: Path) -> CapturedMotion:
    """Joints by name, with rotations; the world of a BVH has y up, and nobody knows its unit.

    Raises:
        RecordingError: it cannot be read, or is no BVH.
    """
    text = read_motion_text(path, "BVH")
    try:
        motion = _MOTION.search(text)
        words = _words(text[: motion.start()]) if motion else iter(())
        if motion is None or next(words, "") != "HIERARCHY":
            raise ValueError("expected HIERARCHY on the first line, and MOTION below it")
        joints = _joints(words)
        frame_time, table = _frames(text[motion.end() :], sum(len(joint.channels) for joint in joints))
        stamps_ns = checked_stamps(np.asarray(frame_time * np.arange(len(table)), np.float64))
    except ValueError as error:
        raise RecordingError(f"{path}: cannot be read as BVH: {error}") from error
    points, rotations = _forward_kinematics(joints, table)
    parents = {joint.name: joint.parent for joint in joints if joint.parent is not None}
    return CapturedMotion(path, "BVH", stamps_ns, points, rotations, parents, knows_unit=False)


def _words(hierarchy: str) -> Iterator[str]:
    """Words of the hierarchy; a joint's name is one."""
    for found in _WORD.finditer(hierarchy):
        yield from filter(None, found.groups())


def _joints(words: Iterator[str]) -> list[_Joint]:
    """The tree, parents first.

    Raises:
        ValueError: it is none.
    """
    joints: dict[str, _Joint] = {}
    above: list[str | None] = []
    name: str | None = None
    for word in words:
        if word in ("ROOT", "JOINT"):
            name = next(words, "")
            if name in joints:
                raise ValueError(f"two joints are named {shown(name)}")
            parent = above[-1] if above else None
            if (word == "ROOT") != (not above) or (joints and word == "ROOT"):
                raise ValueError(
                    f"{word} {shown(name)} stands where it should not; expected one ROOT around all JOINTs"
                )
            joints[name] = _Joint(name, parent, np.zeros(3), ())
        elif word == "End":
            next(words, "")
            name = None
        elif word == "{":
            above.append(name)
            if len(above) > _DEEPEST:
                raise ValueError(f"more than {_DEEPEST} joints hang on each other")
        elif word == "}":
            if not above:
                raise ValueError("a bracket is closed that nobody opened")
            above.pop()
        elif word == "OFFSET":
            offset = np.array([_number(next(words, "")) for _ in range(3)])
            if above and above[-1] is not None:
                of = joints[above[-1]]
                joints[of.name] = _Joint(of.name, of.parent, offset, of.channels)
        elif word == "CHANNELS":
            count = _number(next(words, ""))
            if not 0 <= count <= _MOST_CHANNELS:
                raise ValueError(f"a joint has at most {_MOST_CHANNELS} channels, not {count:g}")
            channels = tuple(next(words, "") for _ in range(int(count)))
            if not above or above[-1] is None:
                raise ValueError("CHANNELS outside of a joint")
            of = joints[above[-1]]
            for channel in channels:
                if channel[:1] not in _AXES or channel[1:] not in ("rotation", "position"):
                    raise ValueError(f"joint {shown(of.name)}: unknown channel {shown(channel)}")
            joints[of.name] = _Joint(of.name, of.parent, of.offset, channels)
        else:
            raise ValueError(f"unexpected word {shown(word)} in the hierarchy")
    if above or not joints:
        raise ValueError("the hierarchy ends before its brackets are closed")
    return list(joints.values())


def _number(word: str) -> float:
    value = float(word)
    if not np.isfinite(value):
        raise ValueError(f"{shown(word)} is no number that a joint can have")
    return value


def _frames(tail: str, channels: int) -> tuple[float, Array]:
    """Time between two frames [s], and the values (K, channels).

    Raises:
        ValueError: they are not what the header says.
    """
    lines = [line for line in tail.splitlines() if line.strip()]
    if len(lines) < 2 or not lines[0].startswith("Frames:") or not lines[1].startswith("Frame Time:"):
        raise ValueError("expected 'Frames:' and 'Frame Time:' below MOTION")
    frame_time = _number(lines[1].split(":")[1])
    rows = []
    for number, line in enumerate(lines[2:], 1):
        words = line.split()
        if len(words) != channels:
            raise ValueError(f"frame {number} has {len(words)} numbers, expected {channels}: one per channel")
        rows.append([_number(word) for word in words])
    if len(rows) < (said := _number(lines[0].split(":")[1])):
        raise ValueError(f"it ends after {len(rows)} frames, 'Frames:' says {said:g}")
    if frame_time <= 0.0:
        raise ValueError(f"Frame Time: {frame_time:g} s between two frames")
    return frame_time, np.array(rows).reshape(-1, channels)


def _forward_kinematics(joints: list[_Joint], table: Array) -> tuple[dict[str, Array], dict[str, Array]]:
    """Places (K, 3) and rotations (K, 3, 3) of joints in a world with z up.

    A joint's channels are turns about its own axes, in the order in which they are listed; a position takes the
    offset's place.
    """
    points: dict[str, Array] = {}
    rotations: dict[str, Array] = {}
    column = 0
    for joint in joints:
        R = np.tile(np.eye(3), (len(table), 1, 1))
        place = np.tile(joint.offset, (len(table), 1))
        for channel in joint.channels:
            values, axis = table[:, column], _AXES[channel[0]]
            column += 1
            if channel.endswith("position"):
                place[:, axis] = values
            else:
                R = R @ exp_so3(np.radians(values)[:, None] * np.eye(3)[axis])
        if joint.parent is None:
            points[joint.name], rotations[joint.name] = place @ Y_UP_TO_Z_UP.T, Y_UP_TO_Z_UP @ R
        else:
            above = rotations[joint.parent]
            points[joint.name] = points[joint.parent] + (above @ place[..., None])[..., 0]
            rotations[joint.name] = above @ R
    return points, rotations
