"""From registered cameras of a range of motion to a body (A 4.2 and appendix), refined and diagnosed."""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.articulation import ArticulatedMotion, motion_of_cameras
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anthropometry import refuse_impossible
from bodycam_ros.calibration.assessment import assess, bone_lengths
from bodycam_ros.calibration.camera_motion import CameraLog, CameraMotion, camera_motion
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.calibration.first_body import first_body
from bodycam_ros.calibration.image_evidence import image_evidence
from bodycam_ros.calibration.joint_centre import check_exercised
from bodycam_ros.calibration.joint_search import FoundJoints, find_joints
from bodycam_ros.calibration.limb_sides import exchange_limbs, exchanged_limbs, wrong_bending
from bodycam_ros.calibration.refinement import MAX_ROWS, refine
from bodycam_ros.calibration.rest_pose import zero_at_rest
from bodycam_ros.calibration.rest_search import find_rest_pose
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.calibration.rig_check import find_misplaced, refuse_rig
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import BodycamError, RangeOfMotionError
from bodycam_ros.estimation.mounted_cameras import EvidenceSettings
from bodycam_ros.files.merged_lines import merge_lines
from bodycam_ros.kinematics.joint_angles import JointAngleTracker
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.registration.readout_time import ReadoutLog
from bodycam_ros.timing.clock_state import ClockSettings

_PERCENTILE = 0.5  # [%] of the states beyond each limit: one wrong state must not open a joint
_RESTING_ROWS = 10  # of the N-pose, beside those of the whole recording
_MARGIN_RAD = 0.09  # of limits beyond what was exercised: people go a little further another day


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
        pose_fit, evidence: noise of landmarks and registrations, those of the solver.
        facing_rad: which way the person faces in the N-pose, about the map's z from its x [rad]; None to read it off
            the hips and shoulders.
        clock: how far the cameras' clocks may be off.
        rest_s: (from, to) when the N-pose is held, in the recording's time [s]; None to search for it.
        first_ns: stamp of the recording's time 0 [ns]; None for that of the first image that is added.

    Raises:
        RangeOfMotionError: the recording lacks a camera of the rig.
    """

    def __init__(
        self,
        rig: Rig,
        cameras: Mapping[str, CameraModel],
        pose_fit: PoseFitSettings | None = None,
        evidence: EvidenceSettings | None = None,
        facing_rad: float | None = None,
        clock: ClockSettings | None = None,
        rest_s: tuple[float, float] | None = None,
        first_ns: int | None = None,
    ) -> None:
        if missing := merge_lines(rig.missing_cameras(cameras)):
            raise RangeOfMotionError(f"{'; '.join(missing)}. The recording has {', '.join(cameras)}")
        self._rig = rig
        self._models = cameras
        self._pose_fit = pose_fit or PoseFitSettings()
        self._evidence = evidence or EvidenceSettings()
        self._facing_rad = facing_rad
        self._clock = clock or ClockSettings()
        self._rest_s, self._first_ns = rest_s, first_ns
        self.forget()

    def forget(self) -> None:
        """Drop what was collected: the range of motion begins anew."""
        self._logs = {camera: CameraLog(camera) for camera in self._rig.cameras}
        self._readouts = ReadoutLog({camera: self._models[camera] for camera in self._rig.cameras})

    def add(self, matches: LandmarkMatches) -> None:
        """Collect one image's registration; of each camera in order of time, cameras in any order."""
        if matches.camera in self._logs:
            self._logs[matches.camera].add(matches)
            self._readouts.add(matches)

    def solve(
        self, name: str = "subject", on_progress: Callable[[str, float], None] = lambda step, share: None
    ) -> CalibratedBody:
        """Estimate the body from what was collected so far.

        Args:
            name: of the body.
            on_progress: called with the step's name and the share of it that is done.

        Raises:
            RigError: cameras are on other segments than the rig says.
            RangeOfMotionError: the recording does not determine a body; with what to repeat.
            MapError: no person has bones of this size, so the map's scale is wrong.
        """
        on_progress("joint centres", 0.0)
        motion = camera_motion(list(self._logs.values()), self._first_ns)
        self._check_rig(motion)
        initial = self._initial_body(name, self._rig, motion)
        found, hinges, resting, rows = initial.found, initial.hinges, initial.resting, initial.rows
        is_resting = np.isin(rows, resting)
        if limbs := exchanged_limbs(initial.motion, is_resting):
            evidence = f"with this rig {wrong_bending(limbs)}"
            raise refuse_rig(self._rig, exchange_limbs(self._rig.cameras, limbs), evidence)
        start = zero_at_rest(initial.motion, is_resting, self._facing_rad, hinges)  # A eq. 16-17
        on_progress("joint centres", 1.0)

        refined = refine(
            start.motion,
            image_evidence(motion, rows, self._models, self._pose_fit, self._evidence),
            start.hinges,
            self._clock,
            lambda share: on_progress("refinement", share),
        )
        zeroed = zero_at_rest(refined.motion, is_resting, self._facing_rad, hinges)
        rest_s = float(motion.seconds[resting[0]]), float(motion.seconds[resting[-1]])
        diagnosis = assess(motion, rows, found, refined, zeroed, rest_s, [*self._logs.values()], self._readouts)
        return CalibratedBody(_limited_body(zeroed.motion, self._readouts.readouts()), diagnosis)

    def _initial_body(self, name: str, rig: Rig, motion: CameraMotion) -> "_InitialBody":
        """The body by joint centres, and the rows of the motion that it is refined by."""
        found = find_joints(rig, motion)  # A eq. 6-7, 12-14
        hinges = check_exercised(rig, found.centres)
        body = first_body(name, rig, found)  # A eq. 15
        # Before what is measured in metres is asked whether it moved.
        refuse_impossible(bone_lengths(body, np.zeros((3 * len(body.joints), 3 * len(body.joints)))))
        resting = find_rest_pose(motion.seconds, found, rig, self._rest_s)
        rows = np.union1d(_spread(len(motion.stamps_ns), MAX_ROWS), resting[_spread(len(resting), _RESTING_ROWS)])
        first = motion_of_cameras(
            body, motion.cameras, motion.world_T_camera[rows], motion.twists[rows], motion.known[rows], motion.triggered
        )
        return _InitialBody(found, hinges, resting, rows, first)

    def _check_rig(self, motion: CameraMotion) -> None:
        """Refuse a rig that has cameras on the wrong segments; raises RigError."""
        misplaced = find_misplaced(self._rig, motion.cameras, motion.world_T_camera, motion.known)
        if misplaced is None:
            return
        cameras = dict(misplaced.cameras)
        with suppress(BodycamError):
            # All joints fit with left and right exchanged as well; knees and elbows tell the two apart.
            mended = self._initial_body("", Rig(cameras, self._rig.parents), motion)
            limbs = exchanged_limbs(mended.motion, np.isin(mended.rows, mended.resting))
            cameras = exchange_limbs(cameras, limbs)
        raise refuse_rig(self._rig, cameras, misplaced.evidence)


@dataclass(frozen=True, eq=False)
class _InitialBody:
    """Joints, child segments of hinges, rows of the N-pose, rows to be used, and the motion of the body at these."""

    found: FoundJoints
    hinges: list[str]
    resting: NDArray[np.intp]
    rows: NDArray[np.intp]
    motion: ArticulatedMotion


def _spread(total: int, most: int) -> NDArray[np.intp]:
    """At most so many of some rows, evenly spread."""
    return np.unique(np.linspace(0, total - 1, min(most, total)).round().astype(np.intp))


def _limited_body(motion: ArticulatedMotion, readouts: Mapping[str, Readout]) -> BodyModel:
    """The body of a motion, its joints limited to what they did and the N-pose, with what is known of cameras' rows."""
    tracker = JointAngleTracker(motion.body)
    angles = np.stack([tracker.angles(poses) for poses in motion.world_T_segment()])
    low, high = np.percentile(angles, [_PERCENTILE, 100.0 - _PERCENTILE], axis=0)
    low, high = np.minimum(low, 0.0) - _MARGIN_RAD, np.maximum(high, 0.0) + _MARGIN_RAD
    limit_of = {name: (float(low[column]), float(high[column])) for column, name in enumerate(tracker.names)}
    joints = tuple(
        replace(joint, limits=tuple(limit_of[name] for name in joint.angle_names)) for joint in motion.body.joints
    )
    mounts = {camera: replace(mount, readout=readouts.get(camera)) for camera, mount in motion.body.mounts.items()}
    return replace(motion.body, joints=joints, mounts=mounts)
