"""BVH: a hierarchy of bones and, frame by frame, the position of the root and three angles per bone.

The middle angle of each bone is about its length, about which no joint rotates by 90 degrees, and the first angle of
the root is about the vertical, about which people rotate without limit; so angles are continuous and stay away from
Euler's singularity. Readers have to use each bone's own order of channels. A gap, which BVH cannot represent, is
interpolated. Lengths are metres unless ``--scale`` changes it, and y is up unless ``--up`` does.
"""

import logging
import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bodycam_ros.files.shown import shown
from bodycam_ros.formats.captured_motion import (
    Y_UP_TO_Z_UP,
    CapturedMotion,
    checked_stamps,
    header_contradictions,
)
from bodycam_ros.formats.figure import Figure, continuous_angles
from bodycam_ros.formats.foreign_text import read_foreign
from bodycam_ros.formats.missing_values import cell_value
from bodycam_ros.formats.sampled_motion import MotionOptions, SampledMotion
from bodycam_ros.geometry import Array, exp_so3

logger = logging.getLogger(__name__)

MARK = "HIERARCHY"

_POSITIONS = "Xposition Yposition Zposition"
_UP, _ROOT_ORDERS = "y", {"y": "yzx", "z": "zyx"}
"""Axis that is up -> the root's order: about the vertical, then sideways, then forward."""

_BONE_ORDERS = {"x": "yxz", "y": "xyz", "z": "xzy"}
"""Axis along a bone -> its order of angles."""


def write_bvh(motion: SampledMotion, options: MotionOptions) -> str:
    """The motion as a BVH document.

    Raises:
        BodyError: two bones would have the same name.
    """
    figure = Figure.from_motion(motion, options, _UP)
    ends = [max(figure.ends(row), key=lambda end: float(np.linalg.norm(end))) for row in range(len(figure.names))]
    orders = tuple(_BONE_ORDERS["xyz"[int(np.abs(end).argmax())]] for end in ends[1:])
    orders = (_ROOT_ORDERS[options.up or _UP], *orders)
    order: list[int] = []
    lines = [MARK, *_bone(figure, orders, 0, 0, order)]
    lines += ["MOTION", f"Frames: {len(motion.stamps_ns)}", f"Frame Time: {1.0 / motion.rate:.9f}"]
    degrees = np.degrees(continuous_angles(orders, figure.local_rotations))
    numbers = np.concatenate([figure.positions[:, 0], degrees[:, order].reshape(len(degrees), -1)], axis=1)
    lines += [" ".join(map("{:.6f}".format, row)) for row in numbers.tolist()]
    return "\n".join(lines) + "\n"


def _bone(figure: Figure, orders: tuple[str, ...], row: int, level: int, written: list[int]) -> list[str]:
    """Lines of a bone and those on it; appends their rows to ``written``."""
    written.append(row)
    rotations = " ".join(f"{axis.upper()}rotation" for axis in orders[row])
    lines = [
        f"{'ROOT' if row == 0 else 'JOINT'} {figure.names[row]}",
        "{",
        f"\tOFFSET {_numbers(figure.offsets[row])}",
        f"\tCHANNELS {f'6 {_POSITIONS}' if row == 0 else '3'} {rotations}",
    ]
    if row in figure.tips:
        lines += ["\tEnd Site", "\t{", f"\t\tOFFSET {_numbers(figure.tips[row])}", "\t}"]
    lines = ["\t" * level + line for line in lines]
    for child in figure.children(row):
        lines += _bone(figure, orders, child, level + 1, written)
    return [*lines, "\t" * level + "}"]


def _numbers(values: Array) -> str:
    return " ".join(f"{value:.6f}" for value in values.tolist())


_AXES = {"X": 0, "Y": 1, "Z": 2}
_MAX_DEPTH = 200  # of joints on each other
_MAX_CHANNELS = 6  # of a joint: three positions, three rotations
_WORD = re.compile(r"(ROOT|JOINT)[^\S\n]+([^\n{}]*[^\s{}])|(\S+)")
"""A word of the hierarchy. A name extends to the end of its line: 3ds Max writes ``ROOT Bip01 Pelvis``."""

_MOTION = re.compile(r"^\s*MOTION\b", re.MULTILINE)
"""A line of its own: the word may be part of a name too."""


@dataclass(eq=False)
class _Joint:
    name: str
    parent: str | None
    offset: Array = field(default_factory=lambda: np.zeros(3))
    channels: tuple[str, ...] = ()


def read_bvh(path: Path) -> CapturedMotion:
    """Joints by name, with rotations; the world of a BVH has y up, and its unit is unknown.

    Raises:
        RecordingError: it cannot be read.
        ValueError: it is no BVH.
    """
    text = read_foreign(path, "BVH file")
    motion = _MOTION.search(text)
    hierarchy = text[: motion.start()] if motion else ""
    words = (word for found in _WORD.finditer(hierarchy) for word in found.groups() if word)
    if motion is None or next(words, "") != MARK:
        raise ValueError("expected HIERARCHY on the first line, and MOTION below it")
    joints = _read_joints(words)
    frames, frame_time, table = _read_frames(text[motion.end() :], sum(len(joint.channels) for joint in joints))
    stamps_ns = checked_stamps(np.asarray(frame_time * np.arange(len(table)), np.float64))
    points, rotations = _forward_kinematics(joints, table)
    parents = {joint.name: joint.parent for joint in joints if joint.parent is not None}
    captured = CapturedMotion(path, "BVH", stamps_ns, points, rotations, parents, has_unit=False)
    for contradiction in header_contradictions(captured, frames, ""):
        logger.warning("%s: %s", path, contradiction)
    return captured


def _read_joints(words: Iterator[str]) -> list[_Joint]:
    """The joints, parents first.

    Raises:
        ValueError: they are no tree.
    """
    joints: dict[str, _Joint] = {}
    opened: list[_Joint | None] = []  # None: an end site
    latest: _Joint | None = None
    for word in words:
        inside = opened[-1] if opened else None
        if word in ("ROOT", "JOINT"):
            name = next(words, "")
            if name in joints:
                raise ValueError(f"two joints are named {shown(name)}")
            if (word == "ROOT") != (not opened) or (joints and word == "ROOT"):
                raise ValueError(f"{word} {shown(name)} is misplaced; expected one ROOT around all JOINTs")
            latest = joints[name] = _Joint(name, inside.name if inside else None)
        elif word == "End":
            next(words, "")
            latest = None
        elif word == "{":
            opened.append(latest)
            if len(opened) > _MAX_DEPTH:
                raise ValueError(f"a chain of more than {_MAX_DEPTH} joints")
        elif word == "}":
            if not opened:
                raise ValueError("a closing bracket without an opening one")
            opened.pop()
        elif word == "OFFSET":
            offset = np.array([_number(next(words, "")) for _ in range(3)])
            if inside is not None:
                inside.offset = offset
        elif word == "CHANNELS":
            count = _number(next(words, ""))
            if not 0 <= count <= _MAX_CHANNELS:
                raise ValueError(f"a joint has at most {_MAX_CHANNELS} channels, not {count:g}")
            if inside is None:
                raise ValueError("CHANNELS outside of a joint")
            inside.channels = tuple(next(words, "") for _ in range(int(count)))
            for channel in inside.channels:
                if channel[:1] not in _AXES or channel[1:] not in ("rotation", "position"):
                    raise ValueError(f"joint {shown(inside.name)}: unknown channel {shown(channel)}")
        else:
            raise ValueError(f"unexpected word {shown(word)} in the hierarchy")
    if opened or not joints:
        raise ValueError("the hierarchy ends before its brackets are closed")
    return list(joints.values())


def _number(word: str) -> float:
    value = cell_value(word)
    if not np.isfinite(value):
        raise ValueError(f"{shown(word)} is not a finite number")
    return value


def _read_frames(text: str, channels: int) -> tuple[str, float, Array]:
    """The count of frames as it is stated, the time between two [s], and the values (K, channels).

    Raises:
        ValueError: they contradict the header.
    """
    lines = [line for line in text.splitlines() if line.strip()]
    if len(lines) < 2 or not lines[0].startswith("Frames:") or not lines[1].startswith("Frame Time:"):
        raise ValueError("expected 'Frames:' and 'Frame Time:' below MOTION")
    frame_time = _number(lines[1].split(":")[1])
    rows = []
    for number, line in enumerate(lines[2:], 1):
        words = line.split()
        if len(words) != channels:
            raise ValueError(f"frame {number} has {len(words)} numbers, expected {channels}: one per channel")
        rows.append([_number(word) for word in words])
    if len(rows) < (expected := _number(lines[0].split(":")[1])):
        raise ValueError(f"it ends after {len(rows)} frames, 'Frames:' says {expected:g}")
    if frame_time <= 0.0:
        raise ValueError(f"Frame Time: {frame_time:g} s between two frames")
    return lines[0].split(":")[1], frame_time, np.array(rows).reshape(-1, channels)


def _forward_kinematics(joints: list[_Joint], table: Array) -> tuple[dict[str, Array], dict[str, Array]]:
    """Positions (K, 3) and rotations (K, 3, 3) of joints in a world with z up.

    A joint's channels are rotations about its own axes, in the order in which they are listed; a position replaces the
    offset.
    """
    points: dict[str, Array] = {}
    rotations: dict[str, Array] = {}
    column = 0
    for joint in joints:
        R = np.tile(np.eye(3), (len(table), 1, 1))
        offset = np.tile(joint.offset, (len(table), 1))
        for channel in joint.channels:
            values, axis = table[:, column], _AXES[channel[0]]
            column += 1
            if channel.endswith("position"):
                offset[:, axis] = values
            else:
                R = R @ exp_so3(np.radians(values)[:, None] * np.eye(3)[axis])
        if joint.parent is None:
            points[joint.name], rotations[joint.name] = offset @ Y_UP_TO_Z_UP.T, Y_UP_TO_Z_UP @ R
        else:
            above = rotations[joint.parent]
            points[joint.name] = points[joint.parent] + (above @ offset[..., None])[..., 0]
            rotations[joint.name] = above @ R
    return points, rotations
