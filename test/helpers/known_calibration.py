"""A calibrated body whose every figure is known: the sample's geometry, with all that can be wrong with one."""

from dataclasses import replace
from itertools import combinations
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import SegmentName
from bodycam_ros.calibration.anthropometry import BoneLength, expected_stature, judge_bones
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis, CameraDiagnosis, JointDiagnosis
from bodycam_ros.kinematics.joint import Joint

SAMPLE_BODY = Path(__file__).parents[2] / "bags" / "body.yaml"
SHORT_THIGH = "thigh_left"
STIFF_JOINT = "elbow_right"
SLIPPED_CAMERA = "shin_right"
HINGES = ("elbow_left", "elbow_right", "knee_left", "knee_right")

_BALL_DEG = (112.0, 83.0, 47.0)
_HINGE_DEG = (124.0, 6.0, 3.0)


def calibrated_body() -> BodyModel:
    """The sample's body with hinges where people have them, and with limits."""
    body = read_body(SAMPLE_BODY)
    return replace(body, name="ada", joints=tuple(_limited(joint) for joint in body.joints))


def good_diagnosis(body: BodyModel) -> CalibrationDiagnosis:
    """The diagnosis of a recording without faults."""
    random = np.random.default_rng(11)
    lengths = _bone_lengths(body)
    return CalibrationDiagnosis(
        joints=tuple(_joint(joint, random) for joint in body.joints),
        bones=tuple(judge_bones(lengths)),
        cameras=tuple(
            CameraDiagnosis(
                camera=camera,
                segment=mount.segment,
                images=1860,
                registered=float(random.uniform(0.95, 1.0)),
                residual_m=float(random.uniform(4e-4, 2e-3)),
                residual_rad=float(random.uniform(3e-4, 2e-3)),
                moved_m=0.0,
                turned_rad=0.0,
                slipped_s=None,
                clock_s=float(random.normal(0.0, 0.01)),
            )
            for camera, mount in body.mounts.items()
        ),
        rest_s=(0.4, 2.9),
        heading_rad=0.31,
        duration_s=62.0,
        stature_m=expected_stature(lengths),
    )


def worrying_diagnosis(body: BodyModel) -> CalibrationDiagnosis:
    """The same with a joint that was held still, a bone that is too short and a strap that slipped."""
    good = good_diagnosis(body)
    joints = [
        replace(
            joint,
            exercised_rad=np.radians([19.0, 3.0, 1.0]),
            gap_m=0.0043,
            sigma_m=np.array([0.009, 0.004, 0.012]),
            advice="elbow_right: turned by 19 deg only; bend and stretch the elbow, swing the right forearm",
        )
        if joint.name == STIFF_JOINT
        else joint
        for joint in good.joints
    ]
    lengths = [replace(bone, length_m=0.31) if bone.segment == SHORT_THIGH else bone for bone in _bone_lengths(body)]
    cameras = [
        replace(
            camera,
            residual_m=0.0112,
            residual_rad=0.021,
            moved_m=0.0234,
            turned_rad=0.11,
            slipped_s=41.7,
            warning="camera shin_right slipped on shin_right at 41.7 s by 23 mm and 6.3 deg; tighten its strap",
        )
        if camera.camera == SLIPPED_CAMERA
        else camera
        for camera in good.cameras
    ]
    return replace(
        good,
        joints=tuple(joints),
        bones=tuple(judge_bones(lengths)),
        cameras=tuple(cameras),
        stature_m=expected_stature(lengths),
    )


def _limited(joint: Joint) -> Joint:
    if joint.name in HINGES:
        bends = (-0.02, 2.14) if joint.name.startswith("knee") else (-2.2, 0.03)
        return replace(joint, type="hinge", sigmas=None, axis=np.array([0.03, 1.0, -0.02]), limits=(bends,))
    return replace(joint, limits=((-0.61, 1.42), (-0.44, 0.52), (-0.38, 0.83)))


def _joint(joint: Joint, random: np.random.Generator) -> JointDiagnosis:
    hinge = joint.type == "hinge"
    exercised = np.radians(_HINGE_DEG if hinge else _BALL_DEG) * random.uniform(0.8, 1.2, size=3)
    return JointDiagnosis(
        name=joint.name,
        parent=joint.parent,
        child=joint.child,
        freedom="hinge" if hinge else "ball",
        exercised_rad=np.sort(exercised)[::-1],
        gap_m=float(random.uniform(3e-4, 1.4e-3)),
        sigma_m=random.uniform(2e-4, 1.2e-3, size=3),
    )


def _bone_lengths(body: BodyModel) -> list[BoneLength]:
    """Between any two joints of a segment."""
    lengths = []
    for segment in body.segments:
        places = {joint.name: joint.parent_T_joint[:3, 3] for joint in body.joints if joint.parent == segment}
        if (above := body.joint_to_parent(segment)) is not None:
            places = {above.name: np.zeros(3), **places}
        for start, end in combinations(places, 2):
            length_m = float(np.linalg.norm(places[end] - places[start]))
            lengths.append(BoneLength(segment, start, end, length_m, 0.0008))
    return lengths


def words(name: str) -> str:
    """The name in words."""
    return SegmentName(name).words
