"""Compares a solved recording with what another system captured (A section 5.1)."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.urdf import optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate import comparison
from bodycam_ros.evaluate.agreement import (
    NONE,
    SIMILARITY,
    Agreement,
    AngleAgreement,
    LimitsOfAgreement,
    PointAgreement,
)
from bodycam_ros.evaluate.alignment import Alignment, Tracked, aligned, clock_of, rate_shared_clock, too_little
from bodycam_ros.evaluate.anatomical_angles import PLANES, angles_of_points, joint_name, kind_and_side, planes_of
from bodycam_ros.evaluate.clock_search import Clock, unit_found
from bodycam_ros.evaluate.comparison import Distribution
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.point_sites import PointSite, locate_points
from bodycam_ros.geometry import Array, log_so3, nearest_rotation
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.results.topics import read_published_body


@dataclass(frozen=True)
class AgreementOptions:
    """How another system's motion is compared.

    Attributes:
        align: which of ``ALIGNMENTS`` brings our world to theirs.
        shares_clock: its stamps are of our clock; else offset and rate are found.
        names: the user's table of names.
    """

    align: str = SIMILARITY
    shares_clock: bool = False
    names: Path | None = None


def agree(solved: SolvedRecording, captured: CapturedMotion, options: AgreementOptions) -> Agreement:
    """Compare.

    Raises:
        RecordingError: names, times or motion do not fit each other.
    """
    joints = joints_of(solved)
    there = [*solved.urdf.segments, *map(optical_frame, solved.urdf.cameras)]
    places = locate_points(captured, there, joints, options.names)
    unit: float | None = None
    if not captured.has_unit:
        exact = {name: place for name, place in places.items() if not place.is_fitted} or places
        origins = {name: solved.world_T_link[place.link][:, :3, 3] for name, place in exact.items()}
        unit = unit_found(origins, captured.points)
        captured = captured.scaled(unit)
    links = {place.link for place in places.values()}
    tracked = Tracked(solved.seconds(solved.stamps_ns), {link: solved.world_T_link[link] for link in links}, places)
    clock = _clock(solved, captured, tracked, options)
    seen: NDArray[np.bool_] = np.any(np.isfinite(tracked.theirs(captured, clock)).all(axis=2), axis=1)
    if not seen.any():
        raise RecordingError(
            f"{captured.path}: has nothing from the time of {solved.path}: by this clock it goes from "
            f"{clock.start_s:.3f} to {clock.start_s + clock.rate * captured.duration_s:.3f} s of it; without "
            "--clock shared the offset is found"
        )
    tracked = Tracked(
        tracked.seconds[seen], {link: poses[seen] for link, poses in tracked.world_T_link.items()}, places
    )
    theirs = tracked.theirs(captured, clock)
    try:
        world = aligned(tracked, theirs, options.align)
        free = aligned(tracked, theirs, options.align, with_scale=True)
        rigid = aligned(tracked, theirs, options.align, with_scale=False)
    except ValueError as error:
        raise too_little(captured, tracked) from error
    points = _points(tracked, theirs, world)
    found = Agreement(
        name=captured.path.resolve().name,
        kind=captured.kind,
        stamps_ns=solved.stamps_ns[seen],
        clock=clock,
        align=options.align,
        scale=free.scale,
        unit_m=unit,
        points=points,
        angles=_angles(solved, captured, clock, places, points, seen),
        left_out=tuple(name for name in captured.points if name not in places),
        rigid_error=np.nan,
    )
    if options.align == NONE:
        return found
    without_scale = replace(found, points=_points(tracked, theirs, rigid))
    return replace(found, rigid_error=float(np.nanmean(without_scale.position_errors)))


def joints_of(solved: SolvedRecording) -> dict[str, str]:
    """Joint of the body -> the segment that hangs on it."""
    return {joint.name: joint.child for joint in read_published_body(solved.path).tree_joints}


def _clock(solved: SolvedRecording, captured: CapturedMotion, tracked: Tracked, options: AgreementOptions) -> Clock:
    if options.shares_clock:
        return rate_shared_clock(tracked, captured, Clock(1e-9 * float(captured.stamps_ns[0] - solved.start_ns)))
    if len(solved.stamps_ns) < 2:
        raise RecordingError(f"{solved.path}: has one instant, by which no clock can be found")
    return clock_of(tracked, captured)


def _points(tracked: Tracked, theirs: Array, world: Alignment) -> tuple[PointAgreement, ...]:
    ours = world.scale * tracked.ours(world.at) @ world.R.T + world.t
    return tuple(
        PointAgreement(name, place.link, place.is_fitted, ours[:, column], theirs[:, column])
        for column, (name, place) in enumerate(tracked.places.items())
    )


def _angles(
    solved: SolvedRecording,
    captured: CapturedMotion,
    clock: Clock,
    places: Mapping[str, PointSite],
    points: tuple[PointAgreement, ...],
    seen: NDArray[np.bool_],
) -> tuple[AngleAgreement, ...]:
    """Joints of which the other system knows the bones on both sides; without any, what centres of joints tell."""
    seconds = clock.theirs(solved.seconds(solved.stamps_ns[seen]))
    bones = bones_of(captured, places)
    turns = {segment: captured.rotations_at(bone, seconds) for segment, bone in bones.items()}
    found = []
    for child, parent in solved.urdf.parent_segments().items():
        if parent in turns and child in turns:
            ours, theirs = (
                np.swapaxes(of[parent], 1, 2) @ of[child]
                for of in ({s: solved.world_T_link[s][seen][:, :3, :3] for s in (parent, child)}, turns)
            )
            found.append(_of_rotations(child, ours, theirs))
    return tuple(found) or _of_points(points)


def bones_of(captured: CapturedMotion, places: Mapping[str, PointSite]) -> dict[str, str]:
    """Segment -> the bone whose rotation is its. A trunk of several bones turns with the one that both arms hang on."""
    found: dict[str, str] = {}
    for name, place in places.items():
        if name in captured.rotations and (place.link not in found or not place.is_fitted):
            found[place.link] = name
    arms = [found[segment] for segment in ("upper_arm_left", "upper_arm_right") if segment in found]
    above = [_above(captured, arm) for arm in arms]
    if len(above) == 2 and "torso" in found and (shared := [bone for bone in above[0] if bone in above[1]]):
        found["torso"] = shared[0]
    return found


def _above(captured: CapturedMotion, bone: str) -> list[str]:
    """Bones that a bone hangs on, the nearest first."""
    names = []
    while (bone := captured.parents.get(bone, "")) != "":
        names.append(bone)
    return names


def _of_rotations(segment: str, ours: Array, theirs: Array) -> AngleAgreement:
    """Rotations (T, 3, 3) of a segment in its parent; how systems lay axes into bones is fitted."""
    known = np.isfinite(theirs).all(axis=(1, 2))
    planes, turned = (np.full((2, len(ours), *shape), np.nan) for shape in ((3,), ()))
    for row, rotations in enumerate((ours[known], in_our_axes(ours[known], theirs[known]))):
        planes[row, known] = planes_of(segment, rotations)
        turned[row, known] = comparison.turned(rotations)
    planes[1] = _of_the_same_turn(planes[0], planes[1])
    return AngleAgreement(segment, planes[0], planes[1], turned[0], turned[1], from_points=False)


def in_our_axes(ours: Array, theirs: Array) -> Array:
    """Their rotations (T, 3, 3) with constant frames that bring them closest to ours.

    Axes of bones may differ by right angles, from where the alternating fit does not always get home. Rotation vectors
    since the first instant differ by the child's frame alone, so it is tried from there, too.
    """
    since = [log_so3(np.swapaxes(R[:1], 1, 2) @ R) for R in (ours, theirs)]
    child = nearest_rotation(since[1].T @ since[0])
    tried = []
    for start in (np.eye(3), child):
        parent = nearest_rotation(np.mean(ours @ np.swapaxes(theirs @ start, 1, 2), axis=0))
        begun = parent @ theirs @ start
        A, B = comparison.fit_constant_frames(ours, begun)
        tried.append((float(comparison.rotation_errors(ours, begun, A, B).mean()), A @ begun @ B))
    return min(tried, key=lambda of: of[0])[1]


def _of_the_same_turn(ours: Array, theirs: Array) -> Array:
    """Angles [rad] less whole turns, so that they are as near ours as they can be."""
    nearest: Array = theirs - 2.0 * np.pi * np.round((theirs - ours) / (2.0 * np.pi))
    return nearest


def _of_points(points: tuple[PointAgreement, ...]) -> tuple[AngleAgreement, ...]:
    centres = {point.link: point for point in reversed(points) if not (point.is_fitted or point.is_camera)}
    if not centres:
        return ()
    known = np.all([np.isfinite(point.theirs).all(axis=1) for point in centres.values()], axis=0)
    if not known.any():
        return ()
    of_ours, of_theirs = (
        angles_of_points({segment: getattr(point, whose)[known] for segment, point in centres.items()})
        for whose in ("ours", "theirs")
    )
    found = []
    for segment in sorted(of_ours, key=_in_order):
        planes = np.full((2, len(known), 3), np.nan)
        planes[:, known] = of_ours[segment], of_theirs[segment]
        since = np.sqrt(np.nansum((planes - planes[:, known][:, :1]) ** 2, axis=2))
        since[:, ~known] = np.nan
        found.append(AngleAgreement(segment, planes[0], planes[1], since[0], since[1], from_points=True))
    return tuple(found)


def _in_order(segment: str) -> tuple[int, str]:
    kinds = ("torso", "head", "upper_arm", "forearm", "hand", "thigh", "shin", "foot")
    kind = kind_and_side(segment)[0]
    return kinds.index(kind) if kind in kinds else len(kinds), segment


CM_PER_M = 100.0


def agreement_figures(agreement: Agreement) -> dict[str, Any]:
    """Figures by name, the unit at the end of the name."""
    turned = list(agreement.angle_errors.values())
    return {
        "with": agreement.name,
        "format": agreement.kind,
        "instants": len(agreement.stamps_ns),
        "align": agreement.align,
        "scale": agreement.scale,
        "unit_m": agreement.unit_m,
        "starts_at_s": agreement.clock.start_s,
        "starts_at_sigma_s": agreement.clock.start_sigma_s,
        "clock_rate": agreement.clock.rate,
        "clock_rate_sigma": agreement.clock.rate_sigma,
        "doubts": list(agreement.doubts),
        "names_left_out": list(agreement.left_out),
        "position_cm": asdict(Distribution.of(CM_PER_M * agreement.position_errors)),
        "position_rigid_mean_cm": CM_PER_M * agreement.rigid_error,
        "angle_deg": asdict(Distribution.of(np.degrees(np.array(turned)))) if turned else None,
        "points": {point.name: _point(point) for point in agreement.points},
        "joints": {joint_name(angle.segment): _angle(angle) for angle in agreement.angles},
    }


def _point(point: PointAgreement) -> dict[str, Any]:
    return {
        "on": point.link,
        "place_fitted": point.is_fitted,
        "seen": float(np.isfinite(point.theirs[:, 0]).mean()),
        "position_cm": asdict(Distribution.of(CM_PER_M * point.errors)),
    }


def _angle(angle: AngleAgreement) -> dict[str, Any]:
    ours, theirs = np.degrees(angle.ours), np.degrees(angle.theirs)
    planes = {
        plane: {"error_deg": asdict(Distribution.of(np.abs(a - b)))} | _limits(a, b)
        for plane, a, b in zip(PLANES, ours.T, theirs.T, strict=True)
        if np.isfinite(b).any()
    }
    turned = np.degrees(np.abs(angle.ours_turned - angle.theirs_turned))
    return {
        "from": "centres of joints" if angle.from_points else "rotations of bones",
        "angle_deg": asdict(Distribution.of(turned)),
        "planes": planes,
    }


def _limits(ours: Array, theirs: Array) -> dict[str, float]:
    return asdict(LimitsOfAgreement.of(ours, theirs))
