"""Assessment of a calibration: figures of every joint, bone and camera."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.articulation import ArticulatedMotion
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import LEFT, SegmentName, mirrored
from bodycam_ros.calibration.anthropometry import BoneLength, expected_stature, judge_bones, odd_scale
from bodycam_ros.calibration.camera_motion import CameraLog, CameraMotion
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis, CameraDiagnosis, JointDiagnosis
from bodycam_ros.calibration.joint_search import FoundJoints
from bodycam_ros.calibration.refinement import STRAIGHT_SIGMA_M, Refined
from bodycam_ros.calibration.rest_pose import ZeroedMotion
from bodycam_ros.calibration.strap_slip import lasting_change, slip_warning
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import Array, inverse, log_se3
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.registration.readout_time import ReadoutLog

_MAX_SIGMA_M = 0.03  # a joint known less well is not known: limbs would be of any length, and no body is written
_WARN_SIGMA_M = 0.006  # a joint known less well is named with what to repeat
_WARN_REGISTERED = 0.5  # a camera registered in a smaller share of its images measures little of its segment


def assess(
    motion: CameraMotion,
    rows: NDArray[np.intp],
    found: FoundJoints,
    refined: Refined,
    zeroed: ZeroedMotion,
    rest_s: tuple[float, float],
    logs: Sequence[CameraLog],
    readouts: ReadoutLog,
) -> CalibrationDiagnosis:
    """Assess a calibration by the results of its steps (``BodyCalibrator``).

    Args:
        motion: of the cameras.
        rows: (N) rows of it that the refinement used.
        found: joints by A eq. 14, and virtual cameras.
        refined: motion of the body at those rows.
        zeroed: the refined motion with the N-pose as zero, its heading and the hinges' axes.
        rest_s: (from, to) [s] of the N-pose.
        logs: of the cameras, in the order of ``motion``.
        readouts: of the cameras' rows.

    Raises:
        RangeOfMotionError: a joint is not known well enough, however much it was moved.
    """
    covariance = _place_covariance(refined, zeroed)
    joints = tuple(_joint(found, zeroed, joint, covariance) for joint in zeroed.motion.body.tree_joints)
    if unknown := [joint for joint in joints if not joint.sigma_m.max() <= _MAX_SIGMA_M]:
        lines = [
            f"joint {joint.name} is uncertain by {1e3 * joint.sigma_m.max():.0f} mm (allowed: "
            f"{1e3 * _MAX_SIGMA_M:.0f} mm): {SegmentName(joint.child).exercise}"
            for joint in unknown
        ]
        raise RangeOfMotionError(
            "the range of motion does not determine every joint. Repeat it with these motions:\n  " + "\n  ".join(lines)
        )
    bones = bone_lengths(zeroed.motion.body, covariance)
    stature_m = expected_stature(bones)
    return CalibrationDiagnosis(
        joints=joints,
        bones=tuple(judge_bones(bones)),
        cameras=_cameras(motion, rows, zeroed.motion, logs, readouts),
        rest_s=rest_s,
        heading_rad=zeroed.heading_rad,
        duration_s=motion.duration_s,
        stature_m=stature_m,
        scale_warning=odd_scale(stature_m),
    )


def _place_covariance(refined: Refined, zeroed: ZeroedMotion) -> Array:
    """Covariance (3 J, 3 J) of the joints' places in their parents, in N-pose axes [m^2].

    Along a hinge's axis the motion carries no information, so that leaving some of it out changes nothing; there the
    straightness of the limb is all that is known.
    """
    motion, body = zeroed.motion, zeroed.motion.body
    count = 3 * len(body.tree_joints)
    zero_R_refined, covariance_along = np.zeros((2, count, count))
    before, after = (each.world_T_segment()[0, :, :3, :3] for each in (refined.motion, motion))
    for row, (joint, parent) in enumerate(zip(body.tree_joints, body.joint_ends[:, 0], strict=True)):
        own = motion.place_columns(row)
        zero_R_refined[own, own] = after[parent].T @ before[parent]
        if (axis := zeroed.hinges.get(joint.child)) is not None:
            covariance_along[own, own] = STRAIGHT_SIGMA_M**2 * np.outer(axis, axis)
    in_motion = zero_R_refined @ refined.covariance[:count, :count] @ zero_R_refined.T
    return np.asarray(in_motion + covariance_along)


def bone_lengths(body: BodyModel, covariance: Array) -> list[BoneLength]:
    """Distances between the joints of each segment, with their standard deviations.

    Args:
        body: of ball joints.
        covariance: (3 J, 3 J) of the joints' places in their parents [m^2].
    """
    bones = []
    for segment in body.segments:
        above = body.joint_to_parent(segment)
        below = [joint for joint in body.tree_joints if joint.parent == segment]
        # The root has no joint above; hips and shoulders are bones between joints below.
        pairs = [(above, joint) for joint in below] if above else []
        pairs += [(left, right) for left in below for right in below if _is_pair(left, right)]
        for start, end in pairs:
            vector, by_offsets = np.zeros(3), np.zeros((3, len(covariance)))
            for joint, sign in ((end, 1.0), (start, 0.0 if start is above else -1.0)):
                vector += sign * joint.parent_T_joint[:3, 3]
                row = 3 * body.joint_row[joint.name]
                by_offsets[:, row : row + 3] = sign * np.eye(3)
            length_m = float(np.linalg.norm(vector))
            slope = vector @ by_offsets / max(length_m, 1e-9)
            sigma_m = float(np.sqrt(np.maximum(slope @ covariance @ slope, 0.0)))
            bones.append(BoneLength(segment, start.name, end.name, length_m, sigma_m))
    return bones


def _is_pair(left: Joint, right: Joint) -> bool:
    return left.child.endswith(LEFT) and right.name == mirrored(left.name)


def _joint(found: FoundJoints, zeroed: ZeroedMotion, joint: Joint, covariance: Array) -> JointDiagnosis:
    motion, axis = zeroed.motion, zeroed.hinges.get(joint.child)
    own = motion.place_columns(motion.body.joint_row[joint.name])
    sigma_m = np.sqrt(np.maximum(np.diag(covariance[own, own]), 0.0))
    # A hinge's place along its axis does not depend on the exercise.
    along = np.zeros(3) if axis is None else STRAIGHT_SIGMA_M * axis
    by_motion = np.sqrt(np.maximum(sigma_m**2 - along**2, 0.0))
    advice = f"joint {joint.name} is known to {1e3 * sigma_m.max():.0f} mm only: {SegmentName(joint.child).exercise}"
    return JointDiagnosis(
        name=joint.name,
        parent=joint.parent,
        child=joint.child,
        freedom="ball" if axis is None else "hinge",
        exercised_rad=motion.exercised(joint.child),
        gap_m=float(np.median(found.centres[joint.child].residuals_m)),
        sigma_m=sigma_m,
        advice=advice if by_motion.max() > _WARN_SIGMA_M else "",
    )


def _cameras(
    measured: CameraMotion, rows: NDArray[np.intp], motion: ArticulatedMotion, logs: Sequence[CameraLog], of: ReadoutLog
) -> tuple[CameraDiagnosis, ...]:
    known, seconds = measured.known[rows], measured.seconds[rows]
    readouts, doubts = of.readouts(), of.doubts()
    off = inverse(motion.world_T_camera()) @ measured.world_T_camera[rows]
    cameras = []
    for c, log in enumerate(logs):
        camera, share = log.camera, log.registered / max(log.images, 1)
        own = off[known[:, c], c]
        slip, errors = lasting_change(own, seconds[known[:, c]]), log_se3(own)
        if slip is not None:
            warning = slip_warning(camera, slip)
        elif share < _WARN_REGISTERED:
            warning = (
                f"camera {camera} was registered in only {100 * share:.0f} % of its images; check what it sees, and "
                "photograph that for the map"
            )
        else:
            warning = doubts.get(camera, "")
        turned, moved = (
            float(np.median(np.linalg.norm(part, axis=1))) if len(own) else float("nan")
            for part in (errors[:, :3], errors[:, 3:])
        )
        cameras.append(
            CameraDiagnosis(
                camera=camera,
                segment=motion.body.mounts[camera].segment,
                images=log.images,
                registered=share,
                residual_m=moved,
                residual_rad=turned,
                moved_m=slip.moved_m if slip else 0.0,
                turned_rad=slip.turned_rad if slip else 0.0,
                slipped_s=slip.seconds if slip else None,
                readout=readouts.get(camera),
                warning=warning,
                clock_s=float(motion.delays[c]),
            )
        )
    return tuple(cameras)
