"""Comparison of a solved recording with what another system captured of the same motion (A section 5.1)."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import combinations
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.camera.model import OPTICAL_SUFFIX, optical_frame
from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.alignment import (
    BodyPoints,
    align_worlds,
    find_motion_clock,
    rate_shared_clock,
)
from bodycam_ros.evaluate.anatomical_angles import (
    AngleAgreement,
    compare_centre_angles,
    compare_rotations,
)
from bodycam_ros.evaluate.clock_search import Clock
from bodycam_ros.evaluate.comparison import TrueMotion
from bodycam_ros.evaluate.figures import AgreementFigures, PointFigures, spread
from bodycam_ros.evaluate.unlabelled_cameras import find_cameras
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.point_sites import PointSite, locate_points
from bodycam_ros.geometry import Array
from bodycam_ros.results.solved_recording import SolvedRecording

_UNITS = (1.0, 0.01, 0.001, 0.0254, 0.0254 / 0.45)
"""Metres, centimetres, millimetres, inches, and the unit of the motions of Carnegie Mellon University."""

_UNIT_NAMES = {1.0: "m", 0.01: "cm", 0.001: "mm", 0.0254: "inches"}
_MAX_NAMES = 12  # of points that are listed

_MIN_LEAD = 2.5
"""Least lead of a clock offset; by nine rates and some 20 offsets, one search in fifty reaches it by chance."""

_MAX_SIGMA_S = 0.05
"""Largest sigma of the clock offset: joints leave some milliseconds, noisy markers 20 ms."""

_MAX_SCALE = 0.05
"""Two systems that measured one person differ by less: a board printed wrong by 1 or 2 %."""


@dataclass(frozen=True)
class AgreementOptions:
    """How another system's motion is compared.

    Attributes:
        with_scale: worlds are aligned by a similarity (A section 5.1); else rigidly.
        shares_clock: its stamps are of our clock; else offset and rate are found.
        names: the user's table of names.
        by_places: names mean nothing: points are camera centres, matched by their places (A section 5.1).
    """

    with_scale: bool = True
    shares_clock: bool = False
    names: Path | None = None
    by_places: bool = False


@dataclass(frozen=True, eq=False)
class PointAgreement:
    """A joint, a marker or a camera over T frames, in the other system's world.

    Attributes:
        name: in the other system.
        link: of ours that it is on.
        is_fitted: its offset on the link was fitted, so that no constant error shows.
        ours, theirs: (T, 3) [m]; theirs NaN where unknown.
    """

    name: str
    link: str
    is_fitted: bool
    ours: Array
    theirs: Array

    @property
    def is_camera(self) -> bool:
        """Whether it is the centre of a body camera."""
        return self.link.endswith(OPTICAL_SUFFIX)

    @property
    def errors(self) -> Array:
        """(T,) [m] distance; NaN where unknown."""
        distance: Array = np.linalg.norm(self.ours - self.theirs, axis=1)
        return distance

    def figures(self) -> PointFigures:
        """The agreement in figures."""
        return PointFigures(
            on=self.link,
            place_fitted=self.is_fitted,
            seen=float(np.isfinite(self.theirs[:, 0]).mean()),
            position_cm=spread(self.errors, 100.0),
        )


@dataclass(frozen=True, eq=False)
class Agreement:
    """Ours and theirs at the T frames that both have.

    Attributes:
        name: of what it is compared with.
        kind: its format: "TRC".
        stamps_ns: (T,) of ours [ns].
        clock: of theirs by ours.
        with_scale: worlds are aligned by a similarity; else rigidly, and a scale is an error.
        by_places: points were matched with cameras by their places alone.
        scale: of theirs over ours, by a similarity.
        unit_m: estimated unit of the file [m]; None where the file declares it.
        points: joints, markers and cameras.
        angles: joints.
        left_out: unknown names of theirs.
        rigid_error: mean position error of joints [m] without a scale.
    """

    name: str
    kind: str
    stamps_ns: NDArray[np.int64]
    clock: Clock
    with_scale: bool
    by_places: bool
    scale: float
    unit_m: float | None
    points: tuple[PointAgreement, ...]
    angles: tuple[AngleAgreement, ...]
    left_out: tuple[str, ...]
    rigid_error: float

    @property
    def doubts(self) -> tuple[str, ...]:
        """Why the two may be of different motions, and what to do; empty where nothing indicates it."""
        clock = self.clock
        off = self.scale - 1.0
        doubts = list[str]()
        if clock.start_sigma_s > 0.0 and clock.lead < _MIN_LEAD:
            doubts.append(
                f"the best clock offset is hardly better than the second best (by {clock.lead:.1f} standard "
                f"deviations of chance, expected {_MIN_LEAD:g} or more)"
            )
        if clock.start_sigma_s > _MAX_SIGMA_S:
            doubts.append(
                f"the clock offset is known to +-{1e3 * clock.start_sigma_s:.0f} ms only, expected "
                f"{1e3 * _MAX_SIGMA_S:.0f} ms or less"
            )
        if abs(off) > _MAX_SCALE:
            doubts.append(f"the scale is {100.0 * off:+z.1f} %, expected {100.0 * _MAX_SCALE:.0f} % or less")
        remedy = "check that it is of the same recording and person, and that its points are right (--points)"
        return tuple(f"{self.name}: {doubt}; {remedy}" for doubt in doubts)

    @property
    def joints(self) -> tuple[PointAgreement, ...]:
        """Joint centres, whose constant errors show; without any, markers, and without these cameras."""
        body = tuple(point for point in self.points if not point.is_camera)
        return tuple(point for point in body if not point.is_fitted) or body or self.points

    @property
    def position_errors(self) -> Array:
        """(T, N) [m] of ``joints``."""
        return np.stack([point.errors for point in self.joints], axis=1)

    @property
    def angle_errors(self) -> Mapping[str, Array]:
        """Segment -> (T,) [rad] the paper's measure: of the turn of a joint since the first frame."""
        return {angle.segment: angle.turn_errors for angle in self.angles}

    def figures(self) -> AgreementFigures:
        """The agreement in figures."""
        clock, angles = self.clock, list(self.angle_errors.values())
        return AgreementFigures(
            other=self.name,
            format=self.kind,
            states=len(self.stamps_ns),
            align="icp" if self.by_places else "similarity" if self.with_scale else "rigid",
            scale=self.scale,
            unit_m=self.unit_m,
            starts_at_s=clock.start_s,
            starts_at_sigma_s=clock.start_sigma_s,
            clock_rate=clock.rate,
            clock_rate_sigma=clock.rate_sigma,
            doubts=list(self.doubts),
            names_left_out=list(self.left_out),
            position_cm=spread(self.position_errors, 100.0),
            position_rigid_mean_cm=100.0 * self.rigid_error,
            angle_deg=spread(np.degrees(np.array(angles))) if angles else None,
            points={point.name: point.figures() for point in self.points},
            joints={SegmentName(angle.segment).joint.replace("_", " "): angle.figures() for angle in self.angles},
        )

    def lines(self) -> list[str]:
        """How the two were compared, in sentences."""
        clock = self.clock
        when = f"Their first frame is at {clock.start_s:.3f} s of this recording"
        if clock.start_sigma_s == 0.0:
            when += ", by its stamps."
        else:
            rate = "has the rate of ours"
            if clock.rate != 1.0:
                rate = f"has seconds of {clock.rate:.5f} +- {clock.rate_sigma:.5f} s"
            when += f" (+-{1e3 * clock.start_sigma_s:.1f} ms), and their clock {rate}."
        scale = f"{self.scale:.4f} ({100.0 * (self.scale - 1.0):+z.2f} %)"
        if self.with_scale:
            rigid = f"{100.0 * self.rigid_error:.2f} cm"
            where = f"Worlds are aligned by a similarity of scale {scale}; without it the mean error is {rigid}."
        else:
            where = f"Worlds are aligned rigidly; a similarity would have a scale of {scale}."
        lines = [f"{when} {where} {len(self.stamps_ns)} frames are compared."]
        if self.unit_m is not None:
            unit = _UNIT_NAMES.get(self.unit_m, f"{self.unit_m:.4f} m")
            lines.append(f"The file does not declare its unit; by the size of the body it is {unit}.")
        if self.by_places:
            found = ", ".join(f"{point.name} is {point.link.removesuffix(OPTICAL_SUFFIX)}" for point in self.points)
            lines.append(f"Its tracks were matched with the cameras by their places alone: {found}.")
        if self.left_out:
            names = ", ".join(self.left_out[:_MAX_NAMES]) + (" ..." if len(self.left_out) > _MAX_NAMES else "")
            lines.append(f"Not compared, because their names are unknown (--points maps them): {names}.")
        return lines


def compare_with_captured(solved: SolvedRecording, captured: CapturedMotion, options: AgreementOptions) -> Agreement:
    """Compare with what another system captured.

    Raises:
        RecordingError: names, times or motion do not fit each other.
    """
    links = [*solved.body.segments, *map(optical_frame, solved.body.mounts)]
    joints = {joint.name: joint.child for joint in solved.body.tree_joints}
    if options.by_places:
        places = find_cameras(solved, captured)
    else:
        places = locate_points(captured, links, joints, options.names)
    unit: float | None = None
    if not captured.has_unit:
        unit = _estimate_unit(solved, captured, places)
        captured = captured.scaled(unit)
    body = _body_points(solved, captured, places)
    if options.shares_clock:
        clock = rate_shared_clock(body, solved.start_ns)
    elif len(solved.stamps_ns) < 2:
        raise RecordingError(f"{solved.path}: has one frame; finding the clock offset needs two or more")
    else:
        clock = find_motion_clock(body)
    theirs = body.theirs(clock)
    known: NDArray[np.bool_] = np.any(np.isfinite(theirs).all(axis=2), axis=1)
    if not known.any():
        raise RecordingError(
            f"{captured.path}: does not overlap with {solved.path}: by its stamps it lasts from "
            f"{clock.start_s:.3f} to {clock.start_s + clock.rate * captured.duration_s:.3f} s of that recording. Leave "
            "out --clock shared, and the offset is estimated"
        )
    body, theirs = body.at(known), theirs[known]
    (similar, scale, _), (rigid, *_) = (align_worlds(body, theirs, with_scale) for with_scale in (True, False))
    points = _compare_points(places, similar if options.with_scale else rigid, theirs)
    agreement = Agreement(
        name=captured.path.resolve().name,
        kind=captured.kind,
        stamps_ns=solved.stamps_ns[known],
        clock=clock,
        with_scale=options.with_scale,
        by_places=options.by_places,
        scale=scale,
        unit_m=unit,
        points=points,
        angles=_compare_angles(body, clock, solved.parents, points),
        left_out=tuple(name for name in captured.points if name not in places),
        rigid_error=np.nan,
    )
    errors = replace(agreement, points=_compare_points(places, rigid, theirs)).position_errors
    return replace(agreement, rigid_error=float(np.nanmean(errors)))


def rate_same_motion(solved: SolvedRecording, truth: TrueMotion) -> Clock:
    """The clock of a truth with stamps of our clock, with the chance that it is of another motion.

    Raises:
        RecordingError: they agree no better than at other offsets in time.
    """
    segments = [segment for segment in solved.body.segments if segment in truth.world_T_segment]
    points = {segment: np.ascontiguousarray(truth.world_T_segment[segment][:, :3, 3]) for segment in segments}
    captured = CapturedMotion(truth.path, "truth", truth.stamps_ns, points)
    places = {segment: PointSite(segment) for segment in segments}
    return rate_shared_clock(_body_points(solved, captured, places), solved.start_ns)


def _body_points(solved: SolvedRecording, captured: CapturedMotion, places: Mapping[str, PointSite]) -> BodyPoints:
    links = {place.link: solved.world_T_link[place.link] for place in places.values()}
    return BodyPoints(captured, solved.seconds(solved.stamps_ns), links, places)


def _estimate_unit(solved: SolvedRecording, captured: CapturedMotion, places: Mapping[str, PointSite]) -> float:
    """Unit of the file [m], by distances between points of the body."""
    exact = {name: place for name, place in places.items() if not place.is_fitted} or places
    names = [name for name in exact if name in captured.points]
    ratios = []
    for pair in combinations(names, 2):
        ours = np.subtract(*(solved.world_T_link[exact[name].link][:, :3, 3] for name in pair))
        theirs = np.subtract(*(captured.points[name] for name in pair))
        ours_m, unknown = (float(np.nanmedian(np.linalg.norm(apart, axis=1))) for apart in (ours, theirs))
        if unknown > 0.0:
            ratios.append(ours_m / unknown)
    ratio = float(np.median(ratios)) if ratios else 1.0
    return min(_UNITS, key=lambda metres: abs(np.log(ratio / metres)))


def _compare_points(places: Mapping[str, PointSite], ours: Array, theirs: Array) -> tuple[PointAgreement, ...]:
    return tuple(
        PointAgreement(name, place.link, place.is_fitted, ours[:, column], theirs[:, column])
        for column, (name, place) in enumerate(places.items())
    )


def _compare_angles(
    body: BodyPoints, clock: Clock, parents: Mapping[str, str], points: tuple[PointAgreement, ...]
) -> tuple[AngleAgreement, ...]:
    """Joints whose bones on both sides the other system has; without any, angles between joint centres."""
    bones, seconds = _match_bones(body.captured, body.places), clock.theirs(body.seconds)
    theirs = {segment: body.captured.rotations_at(bone, seconds) for segment, bone in bones.items()}
    ours = {segment: body.world_T_link[segment][:, :3, :3] for segment in theirs}
    found = tuple(
        compare_rotations(child, *(np.swapaxes(R[parent], 1, 2) @ R[child] for R in (ours, theirs)))
        for child, parent in parents.items()
        if parent in theirs and child in theirs
    )
    if found:
        return found
    centres = [point for point in reversed(points) if not (point.is_fitted or point.is_camera)]
    return compare_centre_angles(
        {point.link: point.ours for point in centres}, {point.link: point.theirs for point in centres}
    )


def _match_bones(captured: CapturedMotion, places: Mapping[str, PointSite]) -> dict[str, str]:
    """Segment -> the bone with its rotation. A trunk of several bones has the lowest one above both arms."""
    found: dict[str, str] = {}
    for name, place in places.items():
        if name in captured.rotations and (place.link not in found or not place.is_fitted):
            found[place.link] = name
    if {"torso", "upper_arm_left", "upper_arm_right"} <= set(found):
        left, right = (_ancestors(captured, found[f"upper_arm_{side}"]) for side in ("left", "right"))
        found["torso"] = next((bone for bone in left if bone in right), found["torso"])
    return found


def _ancestors(captured: CapturedMotion, bone: str) -> list[str]:
    """Bones above a bone, the nearest first."""
    names = []
    while bone := captured.parents.get(bone, ""):
        names.append(bone)
    return names
