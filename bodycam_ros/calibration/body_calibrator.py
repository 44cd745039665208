"""From registered cameras of a range of motion to a body (A 4.2 and appendix), refined and diagnosed."""

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anatomy import SegmentName
from bodycam_ros.calibration.articulation import ArticulatedMotion, articulated
from bodycam_ros.calibration.assessment import Findings, assess
from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.calibration.camera_motion import CameraLog, CameraMotion, camera_motion
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.calibration.first_body import first_body, joints_in_world, place_hinges, root_at_hips, straight_line
from bodycam_ros.calibration.hinge import shift_to_line
from bodycam_ros.calibration.image_evidence import image_evidence, pose_evidence
from bodycam_ros.calibration.joint_centre import JointCentre, find_joint_centre
from bodycam_ros.calibration.joint_exercise import check_exercised
from bodycam_ros.calibration.refinement import StraightLimb, limb_residual_row, refine
from bodycam_ros.calibration.rest_pose import (
    RestPose,
    facing_direction,
    find_rest_pose,
    heading_rotation,
)
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.calibration.strap_slip import (
    JointInView,
    Slip,
    slips_of_lone_cameras,
    slips_on_segment,
    trust_after_slip,
    trust_before_slip,
)
from bodycam_ros.calibration.virtual_camera import VirtualCamera, fuse_cameras
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import inverse, rigid, transform_points
from bodycam_ros.mapping.landmark_matches import LandmarkMatches
from bodycam_ros.mapping.pose_fit import PoseFitSettings
from bodycam_ros.solving.camera_evidence import EvidenceSettings

Array = NDArray[np.float64]

_WRONG_M = 0.1  # [m] beyond it a gap is a wrong registration's, and says no more by being larger


@dataclass(frozen=True)
class CalibratedBody:
    """A body, and what its calibration found out about itself."""

    body: BodyModel
    diagnosis: CalibrationDiagnosis


class BodyCalibrator:
    """Collects the registrations of a range of motion and estimates the body from them.

    Args:
        rig: which camera is on which segment, and how the segments hang together.
        cameras: models of the cameras, by name.
        settings: of all steps.
        pose_fit, evidence: noise of landmarks and registrations, those of the solver.
        facing_rad: which way the person faces in the N-pose, about the map's z from its x [rad]; None to read it off
            the hips and shoulders.

    Raises:
        RangeOfMotionError: the recording lacks a camera of the rig.
    """

    def __init__(
        self,
        rig: Rig,
        cameras: Mapping[str, CameraModel],
        settings: CalibrationSettings | None = None,
        pose_fit: PoseFitSettings | None = None,
        evidence: EvidenceSettings | None = None,
        facing_rad: float | None = None,
    ) -> None:
        if missing := [camera for camera in rig.cameras if camera not in cameras]:
            raise RangeOfMotionError(
                f"the rig names camera {', '.join(missing)}, but the recording has only {', '.join(cameras)}"
            )
        self._rig = rig
        self._models = cameras
        self._settings = settings or CalibrationSettings()
        self._pose_fit = pose_fit or PoseFitSettings()
        self._evidence = evidence or EvidenceSettings()
        self._facing_rad = facing_rad
        self.forget()

    def forget(self) -> None:
        """Drop what was collected: the range of motion begins anew."""
        self._logs = {camera: CameraLog(camera, self._settings.motion_log) for camera in self._rig.cameras}

    def add(self, matches: LandmarkMatches) -> None:
        """Collect one image's registration; of each camera in order of time, cameras in any order."""
        if matches.camera in self._logs:
            self._logs[matches.camera].add(matches)

    def solve(
        self, name: str = "subject", on_progress: Callable[[str, float], None] = lambda step, share: None
    ) -> CalibratedBody:
        """Estimate the body from what was collected so far.

        Args:
            name: of the body.
            on_progress: called with the step's name and the share of it that is done.

        Raises:
            RangeOfMotionError: the recording does not tell, and what to repeat.
        """
        settings = self._settings
        on_progress("joint centres", 0.0)
        motion = camera_motion(list(self._logs.values()), settings.motion_log)
        trust, slips = self._trust(motion)
        virtual = self._virtual_cameras(motion, trust)  # A eq. 6-7
        centres = self._joint_centres(motion, trust, virtual)  # A eq. 12-14
        if lone_slips := slips_of_lone_cameras(self._joints_in_view(motion, virtual, centres), settings.strap_slip):
            slips |= lone_slips
            for camera, slip in lone_slips.items():
                column = motion.cameras.index(camera)
                trust[:, column] = trust_before_slip(motion.known[:, column], slip.row)
            virtual = self._virtual_cameras(motion, trust)
            centres = self._joint_centres(motion, trust, virtual)
        turning_as_hinges = check_exercised(self._rig, centres, settings.joint_centre)

        rest = self._rest_pose(motion, virtual)
        heading_rad = self._heading(centres, rest, turning_as_hinges)
        rest_R_world = heading_rotation(heading_rad).T
        rest_T_virtual = {
            segment: rigid(rest_R_world @ pose[:3, :3], pose[:3, 3]) for segment, pose in rest.world_T_segment.items()
        }
        hinges = {child: rest_T_virtual[child][:3, :3] @ axis for child, axis in turning_as_hinges.items()}
        virtual_T_camera = {camera: T for one in virtual.values() for camera, T in one.virtual_T_camera.items()}
        body = first_body(name, self._rig, centres, virtual_T_camera, rest_T_virtual)  # A eq. 15
        body = place_hinges(body, hinges)  # A eq. 16-17
        on_progress("joint centres", 1.0)

        rows = motion.spread(settings.refinement.max_instants)
        first = self._motion_of(body, motion, virtual, rest_T_virtual, rows)
        images = image_evidence(motion, rows, self._models, self._pose_fit, self._evidence)
        refined = refine(
            first,
            pose_evidence(motion, rows, self._evidence),
            images,
            trust[rows],
            straight_limbs(first, hinges),
            settings.refinement,
            lambda share: on_progress("refinement", share),
        )
        resting = np.isin(rows, rest.instants)
        zeroed, heading_rad, hinges = self._zeroed(refined.motion, resting, heading_rad, hinges)
        findings = Findings(
            rig=self._rig,
            centres=centres,
            hinges=hinges,
            slips=slips,
            motion=motion,
            rows=rows,
            images=images,
            first=first,
            refined=refined,
            zeroed=zeroed,
            body=zeroed.body,
            straight_sigma=settings.refinement.straight_sigma,
            rest_s=(0.0, float(motion.seconds[rest.instants[-1]])),
            heading_rad=heading_rad,
            image_counts={camera: (log.images, log.registered) for camera, log in self._logs.items()},
        )
        body, diagnosis = assess(findings, settings.assessment, settings.anthropometry)
        return CalibratedBody(body, diagnosis)

    def _trust(self, motion: CameraMotion) -> tuple[Array, dict[str, Slip]]:
        """Weights (T, C) of the cameras, less where one slipped, and the slips."""
        trust = motion.known.astype(np.float64)
        slips: dict[str, Slip] = {}
        for segment in self._rig.segments:
            columns = motion.columns(self._rig.cameras_on(segment))
            accused = slips_on_segment(
                self._rig.cameras_on(segment),
                motion.world_T_camera[:, columns],
                motion.known[:, columns],
                motion.seconds,
                self._settings.strap_slip,
            )
            if len(accused) > 1:
                # They moved against each other; the one that slipped also moved against the joints.
                worst = max(accused, key=lambda camera: self._disagreement(motion, camera))
                accused = {worst: accused[worst]}
            slips |= accused
        for camera, slip in slips.items():
            column = motion.cameras.index(camera)
            trust[:, column] = trust_after_slip(motion.known[:, column], slip.row, self._settings.strap_slip)
        return trust, slips

    def _disagreement(self, motion: CameraMotion, camera: str) -> float:
        """How far joints stray on a camera's segment if it alone tells the segment [m]; mean over its joints."""
        segment = self._rig.cameras[camera]
        neighbours = [other for other, parent in self._rig.parents.items() if parent == segment]
        neighbours += [parent for parent in [self._rig.parents[segment]] if parent is not None]
        gaps = []
        for neighbour in neighbours:
            for other in self._rig.cameras_on(neighbour):
                both = motion.known[:, motion.columns((camera, other))].all(axis=1)
                if both.any():
                    camera_T_other = (inverse(motion.poses(camera)) @ motion.poses(other))[both]
                    centre = find_joint_centre(camera_T_other, np.ones(both.sum()), self._settings.joint_centre)
                    gaps.append(float(np.mean(np.minimum(centre.residuals_m, _WRONG_M))))
        return float(np.mean(gaps)) if gaps else 0.0

    def _joints_in_view(
        self, motion: CameraMotion, virtual: Mapping[str, VirtualCamera], centres: Mapping[str, JointCentre]
    ) -> dict[str, list[JointInView]]:
        """Cameras alone on their segment -> the joints of the segment, where the neighbours say that they are."""
        in_view: dict[str, list[JointInView]] = {}
        for child, centre in centres.items():
            parent = str(self._rig.parents[child])
            rows = np.flatnonzero(virtual[child].known & virtual[parent].known)
            sides = ((child, parent, centre.in_parent), (parent, child, centre.in_child))
            for segment, neighbour, on_neighbour in sides:
                cameras = self._rig.cameras_on(segment)
                if len(cameras) == 1:
                    segment_T_neighbour = inverse(virtual[segment].world_T_virtual) @ virtual[neighbour].world_T_virtual
                    places = transform_points(segment_T_neighbour[rows], on_neighbour[None])[:, 0]
                    name, usual_m = SegmentName(child).joint, float(np.median(centre.residuals_m))
                    in_view.setdefault(cameras[0], []).append(
                        JointInView(name, rows, motion.seconds[rows], places, usual_m)
                    )
        return in_view

    def _virtual_cameras(self, motion: CameraMotion, trust: Array) -> dict[str, VirtualCamera]:
        """Segment -> its cameras as one (A eq. 6-7)."""
        virtual = {}
        for segment in self._rig.segments:
            names = self._rig.cameras_on(segment)
            columns = motion.columns(names)
            virtual[segment] = fuse_cameras(names, motion.world_T_camera[:, columns], trust[:, columns])
        return virtual

    def _joint_centres(
        self, motion: CameraMotion, trust: Array, virtual: Mapping[str, VirtualCamera]
    ) -> dict[str, JointCentre]:
        """Child segment -> its joint, from every pair of cameras on the two segments (A eq. 12-14)."""
        centres = {}
        for child in self._rig.segments:
            parent = self._rig.parents[child]
            if parent is None:
                continue
            parent_T_child, weights = [], []
            for a in self._rig.cameras_on(parent):
                world_T_parent = motion.poses(a) @ inverse(virtual[parent].virtual_T_camera[a])
                for b in self._rig.cameras_on(child):
                    world_T_child = motion.poses(b) @ inverse(virtual[child].virtual_T_camera[b])
                    both = trust[:, motion.columns((a, b))].prod(axis=1)
                    parent_T_child.append((inverse(world_T_parent) @ world_T_child)[both > 0])
                    weights.append(both[both > 0])
            poses = np.concatenate(parent_T_child)
            together = max(map(len, parent_T_child))
            if together < self._settings.joint_centre.min_instants:
                raise RangeOfMotionError(
                    f"joint {SegmentName(child).joint}: cameras on {parent} and on {child} were registered together "
                    f"at {together} instants only, of {len(motion.stamps_ns)}; "
                    f"{self._settings.joint_centre.min_instants} are needed. Repeat it where both see the mapped place"
                )
            centres[child] = find_joint_centre(poses, np.concatenate(weights), self._settings.joint_centre)
        return centres

    def _rest_pose(self, motion: CameraMotion, virtual: Mapping[str, VirtualCamera]) -> RestPose:
        return find_rest_pose(
            motion.seconds,
            {segment: one.world_T_virtual for segment, one in virtual.items()},
            {segment: one.known for segment, one in virtual.items()},
            self._settings.rest_pose,
        )

    def _heading(self, centres: Mapping[str, JointCentre], rest: RestPose, hinges: Mapping[str, Array]) -> float:
        if self._facing_rad is not None:
            return self._facing_rad
        # Where on its axis a hinge sits is not known yet, and its axis runs from right to left.
        balls = {child: centre for child, centre in centres.items() if child not in hinges}
        return facing_direction(joints_in_world(self._rig, balls, rest.world_T_segment))

    def _motion_of(
        self,
        body: BodyModel,
        motion: CameraMotion,
        virtual: Mapping[str, VirtualCamera],
        rest_T_virtual: Mapping[str, Array],
        rows: NDArray[np.intp],
    ) -> ArticulatedMotion:
        """The first motion (A 4.2): the root where its cameras are, the others by their rotations alone."""
        rotations = np.stack(
            [virtual[segment].filled()[rows, :3, :3] @ rest_T_virtual[segment][:3, :3].T for segment in body.segments],
            axis=1,
        )
        reference = self._rig.cameras_on(body.root)[0]
        root_T_virtual = body.mounts[reference].segment_T_camera @ inverse(
            virtual[body.root].virtual_T_camera[reference]
        )
        root_positions = (virtual[body.root].filled()[rows] @ inverse(root_T_virtual))[:, :3, 3]
        return articulated(body, motion.cameras, root_positions, rotations)

    def _zeroed(
        self,
        motion: ArticulatedMotion,
        resting: NDArray[np.bool_],
        heading_rad: float,
        hinges: Collection[str],
    ) -> tuple[ArticulatedMotion, float, dict[str, Array]]:
        """The refined motion with the frames of DESIGN 3: the N-pose is zero again, the root midway of the hips.

        Args:
            motion: refined.
            resting: (T) instants in which the N-pose was held.
            heading_rad: that the person faced, as far as known before.
            hinges: child segments of the joints that turned as hinges.

        Returns:
            The motion, the heading [rad], and the hinges' axes (3,) in N-pose axes.
        """
        motion = motion.with_zero_at(resting, heading_rotation(heading_rad))
        if self._facing_rad is None:
            balls = [joint for joint in motion.body.tree_joints if joint.child not in hinges]
            correction_rad = facing_direction(motion.joints_at_zero(balls))
            heading_rad += correction_rad
            motion = motion.with_segment_axes(np.stack([heading_rotation(correction_rad)] * len(motion.body.segments)))
        axes = {child: motion.hinge_axis(child) for child in hinges}
        return motion.with_body(root_at_hips(place_hinges(motion.body_with_geometry(), axes))), heading_rad, axes


def straight_limbs(motion: ArticulatedMotion, hinges: Mapping[str, Array]) -> list[StraightLimb]:
    """What the N-pose says of each hinge's place along its axis (A eq. 17), linearised."""
    limbs = []
    for child, axis in hinges.items():

        def off_line(offsets: Array, child: str = child, axis: Array = axis) -> float:
            body = replace(motion, offsets=offsets).body_with_geometry()
            joint = body.joint_to_parent(child)
            place = np.zeros(3) if joint is None else joint.parent_T_joint[:3, 3]
            return -shift_to_line(place, axis, *straight_line(body, child))

        limbs.append(limb_residual_row(motion, off_line))
    return limbs
