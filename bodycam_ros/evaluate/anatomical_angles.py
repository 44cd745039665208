"""Angles of joints in the anatomical planes, one definition for all joints and systems, and two systems side by side.

The swing of a segment is the shortest turn of its long axis to its direction, the twist the remaining turn about that
axis. The part of the swing about the axis to the left is in the sagittal plane, that about the axis to the front in the
frontal plane; the twist is in the transverse plane. Unlike Cardan or Euler angles these have no gimbal lock before a
limb points the opposite way, and the swing needs no more than the two ends of a limb.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bodycam_ros.body.segment_name import JOINT_ABOVE, RIGHT, SegmentName
from bodycam_ros.evaluate.sections import spread
from bodycam_ros.geometry import Array, exp_so3, log_so3, nearest_rotation

PLANES = ("sagittal", "frontal", "transverse")
"""Positive are flexion, abduction and inward rotation; of the trunk a bend forward, to the left, a turn to the left."""

_ALTERNATIONS = 50  # of the fit of constant frames; it has converged to rounding long before
_WITHIN = 1.96  # standard deviations on either side that 95 % lie within
_ORDER = tuple(JOINT_ABOVE)
_BENDS_BACKWARDS = ("shin",)
_TRUNK = ("torso", "head")


def planes_of(segment: str, parent_R_child: Array) -> Array:
    """Angles (T, 3) [rad] in the planes, of rotations (T, 3, 3) of a segment in its parent.

    Limbs point along -z in the N-pose, x forward, y left; the trunk's segments along z, which swings by the same.
    """
    swing = _swing(-parent_R_child[:, :, 2])
    twist = log_so3(np.swapaxes(exp_so3(swing), 1, 2) @ parent_R_child)[:, 2]
    return _signed(segment, swing, twist)


def _swing(direction: Array) -> Array:
    """Rotation vectors (T, 3) [rad], without a part along z, that turn -z to directions (T, 3)."""
    d = direction / np.linalg.norm(direction, axis=1, keepdims=True)
    across = np.column_stack([d[:, 1], -d[:, 0], np.zeros(len(d))])  # -z x d
    sine = np.linalg.norm(across, axis=1)
    angle = np.arctan2(sine, -d[:, 2])
    swing: Array = across * (angle / np.where(sine > 0.0, sine, 1.0))[:, None]
    return swing


def _signed(segment: str, swing: Array, twist: Array) -> Array:
    """Swing (T, 3) and twist (T,) as angles (T, 3) in the planes, with the signs of anatomy."""
    name = SegmentName(segment)
    mirrored = -1.0 if name.side == RIGHT else 1.0
    signs = [1.0 if name.kind in _BENDS_BACKWARDS else -1.0, mirrored, -mirrored]
    turns = np.column_stack([swing[:, 1], swing[:, 0], twist])
    signed: Array = turns * np.array([1.0, -1.0, 1.0] if name.kind in _TRUNK else signs)
    return signed


def angles_of_centres(centres: Mapping[str, Array]) -> dict[str, Array]:
    """Segment -> angles (T, 3) [rad] in the planes, by joint centres alone; NaN where these do not give them.

    Hips and shoulders swing in the frames of pelvis and torso; knees and elbows are the angle between the two bones,
    which counts as sagittal; twists are unknown.

    Args:
        centres: segment -> its joint to the parent (T, 3).
    """
    frames = _trunk_frames(centres)
    found: dict[str, Array] = {}
    if {"pelvis", "torso"} <= set(frames):
        found["torso"] = planes_of("torso", np.swapaxes(frames["pelvis"], 1, 2) @ frames["torso"])
    for side in ("left", "right"):
        for trunk, upper, lower, last in (
            ("torso", f"upper_arm_{side}", f"forearm_{side}", f"hand_{side}"),
            ("pelvis", f"thigh_{side}", f"shin_{side}", f"foot_{side}"),
        ):
            if not {upper, lower} <= set(centres):
                continue
            bone = centres[lower] - centres[upper]
            unknown = np.full(len(bone), np.nan)
            if trunk in frames:
                direction = (np.swapaxes(frames[trunk], 1, 2) @ bone[..., None])[..., 0]
                found[upper] = _signed(upper, _swing(direction), unknown)
            if last in centres:
                next_bone = centres[last] - centres[lower]
                sine, cosine = np.linalg.norm(np.cross(bone, next_bone), axis=1), (bone * next_bone).sum(axis=1)
                found[lower] = np.column_stack([np.arctan2(sine, cosine), unknown, unknown])
    return found


def _trunk_frames(centres: Mapping[str, Array]) -> dict[str, Array]:
    """Axes (T, 3, 3) of pelvis and torso, forward left up, by hips and shoulders; of those with both."""

    def middle(kind: str, *others: str) -> Array | None:
        pair = [centres[f"{kind}_{side}"] for side in ("left", "right") if f"{kind}_{side}" in centres]
        if len(pair) == 2:
            return np.asarray((pair[0] + pair[1]) / 2.0)
        return next((centres[other] for other in others if other in centres), None)

    below, above = middle("thigh", "pelvis"), middle("upper_arm", "head", "torso")
    frames: dict[str, Array] = {}
    for segment, kind in (("pelvis", "thigh"), ("torso", "upper_arm")):
        if below is not None and above is not None and {f"{kind}_left", f"{kind}_right"} <= set(centres):
            y = centres[f"{kind}_left"] - centres[f"{kind}_right"]
            y = y / np.linalg.norm(y, axis=1, keepdims=True)
            x = np.cross(y, above - below)
            x /= np.linalg.norm(x, axis=1, keepdims=True)
            frames[segment] = np.stack([x, y, np.cross(x, y)], axis=2)
    return frames


def fit_constant_frames(estimated: Array, true: Array) -> tuple[Array, Array]:
    """Constant rotations A, B (3, 3) that bring A true_t B closest to estimated_t, in the chordal sense.

    The axes of a segment are a convention: A is that of the parent, B that of the child. Alternating least squares:
    given one, the other is the mean of the rotations that remain.

    Args:
        estimated: (T, 3, 3) rotation of child in parent.
        true: (T, 3, 3) the same.
    """
    A, B = np.eye(3), np.eye(3)
    for _ in range(_ALTERNATIONS):
        A = nearest_rotation(np.mean(estimated @ _transposed(true @ B), axis=0))
        B = nearest_rotation(np.mean(_transposed(A @ true) @ estimated, axis=0))
    return A, B


def angle_between(first: Array, second: Array) -> Array:
    """(T,) geodesic angle [rad] between rotations (T, 3, 3)."""
    angle: Array = np.linalg.norm(log_so3(_transposed(first) @ second), axis=-1)
    return angle


def _transposed(R: Array) -> Array:
    return np.swapaxes(R, -1, -2)


@dataclass(frozen=True, eq=False)
class AngleAgreement:
    """A joint over T frames.

    Attributes:
        segment: below it.
        ours, theirs: (T, 3) angles [rad] in the anatomical planes; NaN where unknown.
        ours_turned, theirs_turned: (T,) [rad] turn since the first frame (A figure 7a).
        rotation_errors: (T,) [rad] geodesic, with constant frames fitted; None by joint centres alone.
    """

    segment: str
    ours: Array
    theirs: Array
    ours_turned: Array
    theirs_turned: Array
    rotation_errors: Array | None = None

    @property
    def turn_errors(self) -> Array:
        """(T,) [rad] | |log(E_0' E_t)| - |log(T_0' T_t)| | (A figure 7a).

        It is blind to the axis, and wrong as a whole if the first frame is.
        """
        return np.asarray(np.abs(self.ours_turned - self.theirs_turned))

    def figures(self) -> dict[str, Any]:
        """Figures by name, the unit at the end of the name."""
        columns = zip(PLANES, np.degrees(self.ours).T, np.degrees(self.theirs).T, strict=True)
        return {
            "from": "centres of joints" if self.rotation_errors is None else "rotations of bones",
            "angle_deg": spread(np.degrees(self.turn_errors)),
            "planes": {
                plane: {"error_deg": spread(np.abs(ours - theirs))} | limits_of_agreement(ours, theirs)
                for plane, ours, theirs in columns
                if np.isfinite(theirs).any()
            },
        }


def limits_of_agreement(ours: Array, theirs: Array) -> dict[str, float]:
    """Bias, 95 % limits and root mean square of the differences (Bland and Altman 1986); NaN of none."""
    differences = (ours - theirs)[np.isfinite(ours - theirs)]
    if not differences.size:
        return dict.fromkeys(("bias", "low", "high", "rmse"), np.nan)
    bias, sd = float(differences.mean()), float(differences.std())
    rmse = float(np.sqrt((differences**2).mean()))
    return {"bias": bias, "low": bias - _WITHIN * sd, "high": bias + _WITHIN * sd, "rmse": rmse}


def compare_rotations(segment: str, ours: Array, theirs: Array, *, shares_axes: bool = False) -> AngleAgreement:
    """Compare rotations (T, 3, 3) of a segment in its parent; the axes that systems give to bones are fitted.

    Args:
        segment: below the joint.
        ours: known ones.
        theirs: NaN where unknown.
        shares_axes: axes of bones are about the same, as in a truth: the fit starts with theirs.
    """
    known = np.isfinite(theirs).all(axis=(1, 2))
    planes, turns = np.full((2, len(ours), 3), np.nan), np.full((2, len(ours)), np.nan)
    fitted, errors = _in_our_axes(ours[known], theirs[known], shares_axes), np.full(len(ours), np.nan)
    errors[known] = angle_between(fitted, ours[known])
    for row, rotations in enumerate((ours[known], fitted)):
        planes[row, known], turns[row, known] = planes_of(segment, rotations), angle_between(rotations[:1], rotations)
    planes[1] -= 2.0 * np.pi * np.round((planes[1] - planes[0]) / (2.0 * np.pi))
    return AngleAgreement(segment, planes[0], planes[1], turns[0], turns[1], errors)


def _in_our_axes(ours: Array, theirs: Array, shares_axes: bool) -> Array:
    """Their rotations (T, 3, 3) with constant frames that bring them closest to ours.

    Axes of bones may differ by right angles, from where the alternating fit may not converge. Rotation vectors since
    the first frame differ by the child's frame alone, so the fit starts from there, too.
    """
    if shares_axes:
        A, B = fit_constant_frames(ours, theirs)
        return np.asarray(A @ theirs @ B)
    ours_since, theirs_since = (log_so3(np.swapaxes(R[:1], 1, 2) @ R) for R in (ours, theirs))
    tried = []
    for child in (np.eye(3), nearest_rotation(theirs_since.T @ ours_since)):
        parent = nearest_rotation(np.mean(ours @ np.swapaxes(theirs @ child, 1, 2), axis=0))
        start = parent @ theirs @ child
        A, B = fit_constant_frames(ours, start)
        tried.append((float(angle_between(A @ start @ B, ours).mean()), A @ start @ B))
    return min(tried, key=lambda pair: pair[0])[1]


def compare_centre_angles(ours: Mapping[str, Array], theirs: Mapping[str, Array]) -> tuple[AngleAgreement, ...]:
    """Compare angles between joint centres, segment -> (T, 3) [m]; theirs NaN where unknown."""
    if not ours:
        return ()
    known = np.all([np.isfinite(points).all(axis=1) for points in theirs.values()], axis=0)
    if not known.any():
        return ()
    both = [angles_of_centres({name: points[known] for name, points in each.items()}) for each in (ours, theirs)]
    found = []
    for segment in sorted(both[0], key=lambda segment: (_ORDER.index(SegmentName(segment).kind), segment)):
        planes = np.full((2, len(known), 3), np.nan)
        planes[:, known] = both[0][segment], both[1][segment]
        turns = np.sqrt(np.nansum((planes - planes[:, known][:, :1]) ** 2, axis=2))
        turns[:, ~known] = np.nan
        found.append(AngleAgreement(segment, planes[0], planes[1], turns[0], turns[1]))
    return tuple(found)
