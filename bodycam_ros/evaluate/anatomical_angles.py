"""Angles of joints in the anatomical planes, one definition for all joints and for every system.

A segment's swing is the shortest turn that brings its long axis to where it is, its twist the turn about that axis
which is left. Of the swing, what is about the axis that points left is in the sagittal plane, what is about the one
that points forward in the frontal plane; the twist is in the transverse plane. Unlike angles of Cardan or Euler this
knows no gimbal lock before a limb points the opposite way, and the swing needs no more than the two ends of a limb.
"""

from collections.abc import Mapping

import numpy as np

from bodycam_ros.calibration.anthropometry import JOINT_ABOVE, SegmentName
from bodycam_ros.geometry import Array, exp_so3, log_so3

PLANES = ("sagittal", "frontal", "transverse")
"""Positive are flexion, abduction and inward rotation; of the trunk a bend forward, to the left, a turn to the left."""

_BENDS_BACKWARDS = ("shin",)
_TRUNK = ("torso", "head")


def kind_and_side(segment: str) -> tuple[str, str]:
    """``thigh_left`` -> thigh, left; of what has no side the side is empty."""
    name = SegmentName(segment)
    return name.kind, name.side.removeprefix("_")


def joint_name(segment: str) -> str:
    """``thigh_left`` -> hip left; of a segment that nobody knows its own name."""
    kind, side = kind_and_side(segment)
    return f"{JOINT_ABOVE.get(kind, kind.replace('_', ' '))} {side}".strip()


def planes_of(segment: str, parent_R_child: Array) -> Array:
    """Angles (T, 3) [rad] in the planes, of rotations (T, 3, 3) of a segment in its parent.

    Segments hang along -z in the N-pose, x forward, y left; the trunk's stand along z, which swings by the same.
    """
    swing = swing_to(-parent_R_child[:, :, 2])
    twist = log_so3(np.swapaxes(exp_so3(swing), 1, 2) @ parent_R_child)[:, 2]
    return _signed(segment, np.column_stack([swing[:, 1], swing[:, 0], twist]))


def planes_of_direction(segment: str, direction: Array) -> Array:
    """The same of the direction (T, 3) of a limb in its parent; nobody knows its twist, which is NaN."""
    swing = swing_to(direction)
    return _signed(segment, np.column_stack([swing[:, 1], swing[:, 0], np.full(len(swing), np.nan)]))


def swing_to(direction: Array) -> Array:
    """Rotation vectors (T, 3) [rad], without a part along z, that bring -z to directions (T, 3)."""
    d = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    across = np.column_stack([d[:, 1], -d[:, 0]])  # -z x d
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, -d[:, 2])
    swing = np.zeros_like(d)
    swing[:, :2] = across * (angle / np.where(sine > 0.0, sine, 1.0))[:, None]
    return np.asarray(swing, np.float64)


def _signed(segment: str, turns: Array) -> Array:
    """Turns (T, 3) about y, x and the long axis, with the signs that anatomy gives them."""
    kind, side = kind_and_side(segment)
    mirrored = -1.0 if side == "right" else 1.0
    signs = [1.0 if kind in _BENDS_BACKWARDS else -1.0, mirrored, -mirrored]
    signed: Array = turns * np.array([1.0, -1.0, 1.0] if kind in _TRUNK else signs)
    return signed


def frames_of_trunk(points: Mapping[str, Array]) -> dict[str, Array]:
    """Axes (T, 3, 3) of the pelvis and the torso, forward left up, as hips and shoulders have them; of those known.

    Args:
        points: segment -> where the joint is that it hangs on (T, 3).
    """
    frames: dict[str, Array] = {}
    hips = [points[f"thigh_{side}"] for side in ("left", "right") if f"thigh_{side}" in points]
    shoulders = [points[f"upper_arm_{side}"] for side in ("left", "right") if f"upper_arm_{side}" in points]
    middle = (hips[0] + hips[1]) / 2.0 if len(hips) == 2 else points.get("pelvis")
    above = (shoulders[0] + shoulders[1]) / 2.0 if len(shoulders) == 2 else points.get("head", points.get("torso"))
    if middle is None or above is None:
        return {}
    for segment, pair in (("pelvis", hips), ("torso", shoulders)):
        if len(pair) == 2:
            frames[segment] = _axes(pair[0] - pair[1], above - middle)
    return frames


def _axes(left: Array, up: Array) -> Array:
    """Rotations (T, 3, 3) whose columns are forward, left, up; left is exact."""
    y = left / np.linalg.norm(left, axis=1, keepdims=True)
    x = np.cross(y, up)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=2)


def angles_of_points(points: Mapping[str, Array]) -> dict[str, Array]:
    """Segment -> angles (T, 3) [rad] in the planes, as far as centres of joints tell them; NaN where they do not.

    Hips and shoulders swing in the frames of pelvis and torso; knees and elbows are the angle between the two bones,
    which is put into the sagittal plane; what is about a bone's own axis is not known.

    Args:
        points: segment -> where the joint is that it hangs on (T, 3).
    """
    frames = frames_of_trunk(points)
    found: dict[str, Array] = {}
    if {"pelvis", "torso"} <= set(frames):
        found["torso"] = planes_of("torso", np.swapaxes(frames["pelvis"], 1, 2) @ frames["torso"])
    for side in ("left", "right"):
        for trunk, upper, lower, last in (
            ("torso", f"upper_arm_{side}", f"forearm_{side}", f"hand_{side}"),
            ("pelvis", f"thigh_{side}", f"shin_{side}", f"foot_{side}"),
        ):
            if not {upper, lower} <= set(points):
                continue
            bone = points[lower] - points[upper]
            if trunk in frames:
                direction = (np.swapaxes(frames[trunk], 1, 2) @ bone[..., None])[..., 0]
                found[upper] = planes_of_direction(upper, direction)
            if last in points:
                found[lower] = np.full((len(bone), 3), np.nan)
                found[lower][:, 0] = _between(bone, points[last] - points[lower])
    return found


def _between(a: Array, b: Array) -> Array:
    angle: Array = np.arctan2(np.linalg.norm(np.cross(a, b), axis=1), (a * b).sum(axis=1))
    return angle
