"""What a calibration says about itself: figures of every joint, bone and camera."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.articulation import ArticulatedMotion, joints_in_cameras
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.anthropometry import (
    LEFT,
    AnthropometrySettings,
    BoneLength,
    SegmentName,
    expected_stature,
    judge_bones,
    mirrored,
    odd_scale,
)
from bodycam_ros.calibration.camera_motion import CameraMotion
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis, CameraDiagnosis, JointDiagnosis, RefinementGain
from bodycam_ros.calibration.image_evidence import ImageEvidence
from bodycam_ros.calibration.joint_search import FoundJoints
from bodycam_ros.calibration.refinement import Refined
from bodycam_ros.calibration.rest_pose import ZeroedMotion
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.calibration.strap_slip import slip_warning
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import RangeOfMotionError
from bodycam_ros.geometry import inverse, log_se3, transform_points
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.settings import setting

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Findings:
    """All that the steps of a calibration found; see ``BodyCalibrator``.

    Attributes:
        rig: names.
        delays_before_s: camera -> by how much its clock was taken to be ahead when the motion was found [s].
        found: joints by A eq. 14, virtual cameras and slips.
        motion: of the cameras.
        rows: (N) instants of it that the refinement used.
        images: their landmarks.
        first: the motion of the body before refinement, at those instants.
        refined: after it, in the same frames.
        zeroed: the refined motion with the N-pose as zero, its heading and the hinges' axes.
        straight_sigma: how straight a limb stands in the N-pose [m].
        rest_s: (from, to) [s] of the N-pose.
        image_counts: camera -> images seen, registered.
        readouts: camera -> how long its rows are read out.
        doubts: camera -> what is not known of that, and what it may cost, of those that are doubtful.
    """

    rig: Rig
    delays_before_s: Mapping[str, float]
    found: FoundJoints
    motion: CameraMotion
    rows: NDArray[np.intp]
    images: ImageEvidence
    first: ArticulatedMotion
    refined: Refined
    zeroed: ZeroedMotion
    straight_sigma: float
    rest_s: tuple[float, float]
    image_counts: Mapping[str, tuple[int, int]]
    readouts: Mapping[str, Readout]
    doubts: Mapping[str, str]

    @property
    def delays_s(self) -> dict[str, float]:
        """Camera -> by how much its clock is ahead of the reference's [s]; see ``CameraDiagnosis.clock_s``."""
        motion = self.refined.motion
        return {
            camera: self.delays_before_s[camera] + float(delay)
            for camera, delay in zip(motion.cameras, motion.delays, strict=True)
        }

    @property
    def body(self) -> BodyModel:
        """The body of ``zeroed``."""
        return self.zeroed.motion.body

    @property
    def hinges(self) -> Mapping[str, Array]:
        """Child segment -> (3,) axis of those joints that turned as hinges, in N-pose axes."""
        return self.zeroed.hinges

    def offset_covariance(self) -> Array:
        """Covariance (3 S, 3 S) of the joints' places in their parents, in N-pose axes [m^2].

        Along a hinge's axis the motion tells nothing, so that leaving some of it out changes nothing; there the
        straightness of the limb is all that is known.
        """
        refined, zeroed = self.refined.motion, self.zeroed.motion
        count = 3 * len(self.body.segments)
        zero_R_refined = np.zeros((count, count))
        covariance_along = np.zeros((count, count))
        for row, parent in enumerate(zeroed.parent_rows):
            columns = zeroed.offset_columns(row)
            parent = max(parent, 0)
            zero_R_refined[columns, columns] = zeroed.rotations[0, parent].T @ refined.rotations[0, parent]
            axis = self.hinges.get(self.body.segments[row])
            if axis is not None:
                covariance_along[columns, columns] = self.straight_sigma**2 * np.outer(axis, axis)
        in_motion = zero_R_refined @ self.refined.covariance[:count, :count] @ zero_R_refined.T
        return in_motion + covariance_along


@dataclass(frozen=True)
class AssessmentSettings:
    """When a figure is worth a warning or an error."""

    warn_sigma: float = setting(
        0.006, unit="m", limits=(0.0, 1.0), reason="a joint known less well is named with what to repeat"
    )
    max_sigma: float = setting(
        0.03,
        unit="m",
        limits=(0.001, 1.0),
        reason="a joint known less well than this is not known: no body is written, since limbs would be of any length",
    )
    warn_registered: float = setting(
        0.5, limits=(0.0, 1.0), reason="a camera registered in a smaller share of its images says little of its segment"
    )


def assess(
    findings: Findings, body: BodyModel, settings: AssessmentSettings, anthropometry: AnthropometrySettings
) -> CalibrationDiagnosis:
    """Judge a calibration.

    Args:
        findings: of its steps.
        body: with its joint limits.
        settings, anthropometry: when to warn.

    Raises:
        RangeOfMotionError: a joint is not known well enough, however much it was moved.
    """
    joints = tuple(_joint(findings, joint, settings) for joint in body.tree_joints)
    _refuse_unknown(joints, settings)
    bones = bone_lengths(findings)
    stature_m = expected_stature(bones, anthropometry)
    return CalibrationDiagnosis(
        joints=joints,
        bones=tuple(judge_bones(bones, anthropometry)),
        cameras=_cameras(findings, settings),
        refinement=_gain(findings),
        rest_s=findings.rest_s,
        heading_rad=findings.zeroed.heading_rad,
        duration_s=float(findings.motion.seconds[-1]),
        stature_m=stature_m,
        scale_warning=odd_scale(stature_m, anthropometry),
    )


def bone_lengths(findings: Findings) -> list[BoneLength]:
    """Distances between the joints of each segment, with their standard deviations."""
    body, covariance = findings.body, findings.offset_covariance()
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
                row = body.segment_index[joint.child]
                vector += sign * joint.parent_T_joint[:3, 3]
                by_offsets[:, findings.zeroed.motion.offset_columns(row)] = sign * np.eye(3)
            length_m = float(np.linalg.norm(vector))
            slope = vector @ by_offsets / max(length_m, 1e-9)
            variance = float(slope @ covariance @ slope)
            sigma_m = float(np.sqrt(max(0.0, variance)))
            bones.append(BoneLength(segment, start.name, end.name, length_m, sigma_m))
    return bones


def _is_pair(left: Joint, right: Joint) -> bool:
    return left.child.endswith(LEFT) and right.name == mirrored(left.name)


def _joint(findings: Findings, joint: Joint, settings: AssessmentSettings) -> JointDiagnosis:
    centre = findings.found.centres[joint.child]
    named = SegmentName(joint.child)
    columns = findings.zeroed.motion.offset_columns(findings.body.segment_index[joint.child])
    sigma_m = np.sqrt(np.maximum(np.diag(findings.offset_covariance()[columns, columns]), 0.0))
    hinge = joint.child in findings.hinges
    straight = any(other.parent == joint.child for other in findings.body.tree_joints)
    cameras = (*findings.rig.cameras_on(joint.parent), *findings.rig.cameras_on(joint.child))
    parent, child = (findings.body.segment_index[segment] for segment in (joint.parent, joint.child))
    both = findings.refined.weights > 0
    carriers = np.array(findings.zeroed.motion.carriers)
    frames = int((both[:, carriers == parent].any(axis=1) & both[:, carriers == child].any(axis=1)).sum())
    advice = ""
    # A hinge's place along its axis is no matter of exercise.
    if _by_motion(sigma_m, joint, findings).max() > settings.warn_sigma:
        advice = f"joint {joint.name} is known to {1e3 * sigma_m.max():.0f} mm only: {named.exercise}"
    return JointDiagnosis(
        name=joint.name,
        parent=joint.parent,
        child=joint.child,
        freedom="hinge" if hinge else "ball",
        axis=findings.hinges.get(joint.child),
        exercised_rad=findings.zeroed.motion.exercised(joint.child),
        singular_values=centre.singular_values,
        residual_m=float(np.median(centre.residuals_m)),
        refined_residual_m=_gap(findings, joint),
        sigma_m=sigma_m,
        limits=joint.limits or (),
        frames=frames,
        cameras=cameras,
        placed_by="motion" if not hinge else "collinearity" if straight else "vertical",
        advice=advice,
    )


def _by_motion(sigma_m: Array, joint: Joint, findings: Findings) -> Array:
    """Standard deviations (3,) [m] without what straightness has to tell."""
    axis = findings.hinges.get(joint.child)
    along = np.zeros(3) if axis is None else findings.straight_sigma * axis
    return np.sqrt(np.maximum(sigma_m**2 - along**2, 0.0))


def _gap(findings: Findings, joint: Joint) -> float:
    """Median distance [m] between a joint's two places when each camera is taken at its own word."""
    motion, rows, body = findings.motion, findings.rows, findings.body
    gaps = []
    for a in findings.rig.cameras_on(joint.parent):
        for b in findings.rig.cameras_on(joint.child):
            columns = [motion.cameras.index(camera) for camera in (a, b)]
            seen = motion.known[rows][:, columns].all(axis=1)
            world_T_pair = motion.world_T_camera[rows][seen][:, columns]
            place = []
            for index, (camera, joint_on_segment) in enumerate(
                ((a, joint.parent_T_joint[:3, 3]), (b, joint.child_T_joint[:3, 3]))
            ):
                segment_T_camera = body.mounts[camera].segment_T_camera
                camera_p = transform_points(inverse(segment_T_camera), joint_on_segment[None])
                place.append(transform_points(world_T_pair[:, index], camera_p[None])[:, 0])
            gaps.append(np.linalg.norm(place[0] - place[1], axis=1))
    together = np.concatenate(gaps)
    return float(np.median(together)) if len(together) else float("nan")


def _refuse_unknown(joints: tuple[JointDiagnosis, ...], settings: AssessmentSettings) -> None:
    lost = [joint for joint in joints if not joint.sigma_m.max() <= settings.max_sigma]
    if lost:
        lines = [
            f"joint {joint.name} is known to {1e3 * joint.sigma_m.max():.0f} mm only (at most "
            f"{1e3 * settings.max_sigma:.0f} will do): {SegmentName(joint.child).exercise}"
            for joint in lost
        ]
        raise RangeOfMotionError(
            "the range of motion does not tell where every joint is. Repeat it, and\n  " + "\n  ".join(lines)
        )


def _cameras(findings: Findings, settings: AssessmentSettings) -> tuple[CameraDiagnosis, ...]:
    seconds = findings.motion.seconds
    said = findings.motion.world_T_camera[findings.rows]
    known = findings.motion.known[findings.rows]
    errors = log_se3(inverse(findings.zeroed.motion.world_T_camera()) @ said)
    told = []
    for c, camera in enumerate(findings.motion.cameras):
        images, registered = findings.image_counts[camera]
        slip = findings.found.slips.get(camera)
        slipped_s = None
        seen = errors[known[:, c], c]
        share = registered / max(images, 1)
        warning = ""
        if slip is not None:
            slipped_s = float(seconds[slip.row])
            alone = len(findings.rig.cameras_on(findings.rig.cameras[camera])) == 1
            warning = slip_warning(camera, slip, slipped_s, alone)
        elif share < settings.warn_registered:
            warning = f"camera {camera} was registered in {100 * share:.0f} % of its images only: what does it see?"
        else:
            warning = findings.doubts.get(camera, "")
        told.append(
            CameraDiagnosis(
                camera=camera,
                segment=findings.rig.cameras[camera],
                images=images,
                registered=share,
                residual_m=float(np.median(np.linalg.norm(seen[:, 3:], axis=1))) if len(seen) else float("nan"),
                residual_rad=float(np.median(np.linalg.norm(seen[:, :3], axis=1))) if len(seen) else float("nan"),
                moved_m=slip.moved_m if slip else 0.0,
                turned_rad=slip.turned_rad if slip else 0.0,
                slipped_s=slipped_s,
                readout=findings.readouts.get(camera),
                warning=warning,
                clock_s=findings.delays_s[camera],
            )
        )
    return tuple(told)


def _gain(findings: Findings) -> RefinementGain:
    before, after = (
        float(np.median(images.errors_px(motion.world_T_camera())))
        for images, motion in ((findings.images, findings.first), (findings.refined.images, findings.refined.motion))
    )
    moved_m = np.linalg.norm(
        joints_in_cameras(findings.first.body_with_geometry()) - joints_in_cameras(findings.body), axis=1
    )
    return RefinementGain(
        instants=len(findings.rows),
        landmarks=findings.images.measurements,
        iterations=findings.refined.iterations,
        before_px=before,
        after_px=after,
        moved_m=float(np.median(moved_m)),
        moved_most_m=float(moved_m.max()),
    )
