"""Angles of joints in the anatomical planes, one definition for all joints and systems, and two systems side by side.

The swing of a segment is the shortest turn of its long axis to its direction, the twist the remaining turn about that
axis. The part of the swing about the axis to the left is in the sagittal plane, that about the axis to the front in the
frontal plane; the twist is in the transverse plane. Unlike Cardan or Euler angles these have no gimbal lock before a
limb points the opposite way, and the swing needs no more than the two ends of a limb.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from bodycam_ros.body.segment_name import JOINT_ABOVE, LEFT, RIGHT, SegmentName
from bodycam_ros.evaluate.figures import JointFigures, PlaneFigures, spread
from bodycam_ros.geometry import Array, exp_so3, log_so3, nearest_rotation

PLANES = ("sagittal", "frontal", "transverse")
"""Positive are flexion, abduction and inward rotation; of the trunk a bend forward, to the left, a turn to the left."""

_ALTERNATIONS = 50  # of the fit of constant frames; it has converged to rounding long before
_WITHIN = 1.96  # standard deviations on either side that 95 % lie within
_ORDER = tuple(JOINT_ABOVE)
_BENDS_BACKWARDS = ("shin",)
_TRUNK = ("torso", "head")
_ARM, _LEG = ("torso", "upper_arm", "forearm", "hand"), ("pelvis", "thigh", "shin", "foot")
_LIMBS = _ARM, _LEG

LEG_JOINTS = tuple(JOINT_ABOVE[segment] for segment in _LEG[1:])
"""Hip, knee, ankle."""

LEGS = frozenset(f"{segment}{side}" for segment in _LEG[1:] for side in (LEFT, RIGHT)) | {_LEG[0]}
"""The segments that these joints lie between, of both sides."""


def planes_of(segment: str, parent_R_child: Array) -> Array:
    """Angles (T, 3) [rad] in the planes, of rotations (T, 3, 3) of a segment in its parent.

    Limbs point along -z in the N-pose, x forward, y left; the trunk's segments along z, which swings by the same.
    """
    swing = _swing(-parent_R_child[:, :, 2])
    twist = log_so3(_transposed(exp_so3(swing)) @ parent_R_child)[:, 2]
    return _signed(segment, swing, twist)


def flexion_angles(world_T_segment: Mapping[str, Array]) -> dict[tuple[str, str], Array]:
    """(joint, side) -> flexion (T,) [deg] of limbs, as ("knee", "left"), where both segments are known.

    Args:
        world_T_segment: segment -> (T, 4, 4) [m].
    """
    found = {}
    for limb in _LIMBS:
        for side in (LEFT, RIGHT):
            names = [limb[0], *(f"{segment}{side}" for segment in limb[1:])]
            for above, below in pairwise(names):
                if {above, below} <= set(world_T_segment):
                    world_R_above, world_R_below = (world_T_segment[name][:, :3, :3] for name in (above, below))
                    planes = planes_of(below, _transposed(world_R_above) @ world_R_below)
                    found[JOINT_ABOVE[SegmentName(below).kind], side[1:]] = np.degrees(np.unwrap(planes[:, 0]))
    return found


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
    frames = {trunk: frame for trunk, pair, *_ in _LIMBS if (frame := _trunk_frame(centres, pair)) is not None}
    found: dict[str, Array] = {}
    if len(frames) == len(_LIMBS):
        found["torso"] = planes_of("torso", _transposed(frames["pelvis"]) @ frames["torso"])
    for side in ("left", "right"):
        for trunk, *limb in _LIMBS:
            upper, lower, last = (f"{kind}_{side}" for kind in limb)
            if not {upper, lower} <= set(centres):
                continue
            bone = centres[lower] - centres[upper]
            unknown = np.full(len(bone), np.nan)
            if trunk in frames:
                direction = (_transposed(frames[trunk]) @ bone[..., None])[..., 0]
                found[upper] = _signed(upper, _swing(direction), unknown)
            if last in centres:
                next_bone = centres[last] - centres[lower]
                sine, cosine = np.linalg.norm(np.cross(bone, next_bone), axis=1), (bone * next_bone).sum(axis=1)
                found[lower] = np.column_stack([np.arctan2(sine, cosine), unknown, unknown])
    return found


def _trunk_frame(centres: Mapping[str, Array], kind: str) -> Array | None:
    """Axes (T, 3, 3) of pelvis or torso, forward left up, by both hips or both shoulders, and the middles of both."""

    def middle(kind: str, *others: str) -> Array | None:
        pair = [centres[name] for name in (f"{kind}_left", f"{kind}_right") if name in centres]
        if len(pair) == 2:
            return np.asarray((pair[0] + pair[1]) / 2.0)
        return next((centres[other] for other in others if other in centres), None)

    below, above = middle("thigh", "pelvis"), middle("upper_arm", "head", "torso")
    if below is None or above is None or not {f"{kind}_left", f"{kind}_right"} <= set(centres):
        return None
    y = centres[f"{kind}_left"] - centres[f"{kind}_right"]
    y = y / np.linalg.norm(y, axis=1, keepdims=True)
    x = np.cross(y, above - below)
    x /= np.linalg.norm(x, axis=1, keepdims=True)
    return np.stack([x, y, np.cross(x, y)], axis=2)


def angle_between(first: Array, second: Array) -> Array:
    """(T,) geodesic angle [rad] between rotations (T, 3, 3)."""
    angle: Array = np.linalg.norm(log_so3(_transposed(first) @ second), axis=-1)
    return angle


def _transposed(R: Array) -> Array:
    return np.swapaxes(R, -1, -2)


@dataclass(frozen=True, eq=False)
class AngleAgreement:
    """A joint over T frames; NaN where it is unknown.

    Attributes:
        segment: below it.
        ours, theirs: (T, 3) angles [rad] in the anatomical planes.
        turn_errors: (T,) [rad] | |log(E_0' E_t)| - |log(T_0' T_t)| | (A figure 7a): of the turn since the first known
            frame. It is blind to the axis, and wrong as a whole if the first frame is.
        rotation_errors: (T,) [rad] geodesic, with constant frames fitted; None by joint centres alone.
    """

    segment: str
    ours: Array
    theirs: Array
    turn_errors: Array
    rotation_errors: Array | None = None

    def figures(self) -> JointFigures:
        """The agreement in figures."""
        columns = zip(PLANES, np.degrees(self.ours).T, np.degrees(self.theirs).T, strict=True)
        return JointFigures(
            source="centres of joints" if self.rotation_errors is None else "rotations of bones",
            angle_deg=spread(np.degrees(self.turn_errors)),
            planes={plane: plane_figures(ours, theirs) for plane, ours, theirs in columns if np.isfinite(theirs).any()},
        )


def plane_figures(ours: Array, theirs: Array) -> PlaneFigures:
    """Differences of angles (T,) [deg] in a plane, with 95 % limits of agreement (Bland and Altman 1986)."""
    differences, errors = (ours - theirs)[np.isfinite(ours - theirs)], spread(np.abs(ours - theirs))
    if not differences.size:
        return PlaneFigures(errors, np.nan, np.nan, np.nan, np.nan)
    bias, sd = float(differences.mean()), float(differences.std())
    rmse = float(np.sqrt((differences**2).mean()))
    return PlaneFigures(errors, bias, bias - _WITHIN * sd, bias + _WITHIN * sd, rmse)


def compare_rotations(segment: str, ours: Array, theirs: Array, *, shares_axes: bool = False) -> AngleAgreement:
    """Compare rotations (T, 3, 3) of a segment in its parent; the axes that systems give to bones are fitted.

    Args:
        segment: below the joint.
        ours: known ones.
        theirs: NaN where unknown.
        shares_axes: axes of bones are about the same, as in a truth: the fit starts with theirs.
    """
    known = np.isfinite(theirs).all(axis=(1, 2))
    A, B = _fit_constant_frames(ours[known], theirs[known], shares_axes)
    fitted = A @ theirs @ B
    our_planes, their_planes = planes_of(segment, ours), planes_of(segment, fitted)
    their_planes -= 2.0 * np.pi * np.round((their_planes - our_planes) / (2.0 * np.pi))
    turned, true = (angle_between(each[known][:1], each) for each in (ours, fitted))
    return AngleAgreement(segment, our_planes, their_planes, np.abs(turned - true), angle_between(fitted, ours))


def _fit_constant_frames(ours: Array, theirs: Array, shares_axes: bool) -> tuple[Array, Array]:
    """Constant rotations A, B (3, 3) of parent and child that bring A theirs_t B closest to ours_t (T, 3, 3).

    Alternating least squares, in the chordal sense: given one, the other is the mean of the rotations that remain. Axes
    of bones may differ by right angles, from where it may not converge. Rotation vectors since the first frame differ
    by the child's frame alone, so the fit starts from there, too.
    """
    starts = [np.eye(3)]
    if not shares_axes:
        ours_since, theirs_since = (log_so3(_transposed(R[:1]) @ R) for R in (ours, theirs))
        starts.append(nearest_rotation(theirs_since.T @ ours_since))
    tried = []
    for B in starts:
        for _ in range(_ALTERNATIONS):
            A = nearest_rotation(np.mean(ours @ _transposed(theirs @ B), axis=0))
            B = nearest_rotation(np.mean(_transposed(A @ theirs) @ ours, axis=0))
        tried.append((A, B))
    return min(tried, key=lambda frames: float(angle_between(frames[0] @ theirs @ frames[1], ours).mean()))


def compare_centre_angles(ours: Mapping[str, Array], theirs: Mapping[str, Array]) -> tuple[AngleAgreement, ...]:
    """Compare angles between joint centres, segment -> (T, 3) [m]; theirs NaN where unknown."""
    our_angles, their_angles = angles_of_centres(ours), angles_of_centres(theirs)
    found = []
    for segment in sorted(our_angles, key=lambda segment: (_ORDER.index(SegmentName(segment).kind), segment)):
        planes = np.stack([our_angles[segment], their_angles[segment]])
        known = np.isfinite(planes[:, :, 0]).all(axis=0)
        if known.any():
            turned, true = np.sqrt(np.nansum((planes - planes[:, known][:, :1]) ** 2, axis=2))
            errors = np.where(known, np.abs(turned - true), np.nan)
            found.append(AngleAgreement(segment, planes[0], planes[1], errors))
    return tuple(found)
