"""The calibration of issue 3 on the recordings with ground truth, and the walk solved with its body."""

import os
from pathlib import Path

import numpy as np
import pytest
import yaml

from bodycam_ros.body.body_file import write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.body_calibrator import CalibratedBody
from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.evaluate.comparison import compare
from bodycam_ros.evaluate.true_motion import read_true_motion
from bodycam_ros.geometry import inverse, transform_points
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.replay.calibrate import calibrate
from bodycam_ros.replay.replay import replay
from bodycam_ros.solved.solved_recording import read_solved

JOBS = os.cpu_count() or 1


@pytest.fixture(scope="module")
def rom(shared: Path) -> Path:
    return shared / "dev_rom"


@pytest.fixture(scope="module")
def calibrated(rom: Path, sample: Path) -> CalibratedBody:
    rig = Rig.from_yaml(rom / "rig.yaml")
    return calibrate(rom / "bag", sample / "map", rig, "subject", PipelineSettings(), CalibrationSettings(), JOBS)


def joint_errors_in_cameras(body: BodyModel, rom: Path) -> list[float]:
    """Distances [m] between where a joint is in a camera's frame and where it truly is."""
    truth = yaml.safe_load((rom / "truth" / "mounts.yaml").read_text())
    errors = []
    for camera, mount in body.mounts.items():
        for joint in body.joints:
            on_segment = {joint.parent: joint.parent_T_joint[:3, 3], joint.child: np.zeros(3)}.get(mount.segment)
            if on_segment is not None:
                found = transform_points(inverse(mount.segment_T_camera), on_segment[None])[0]
                errors.append(float(np.linalg.norm(found - truth[camera]["joints_in_camera"][joint.name])))
    return errors


def test_bones_are_as_long_as_they_are(calibrated: CalibratedBody, rom: Path) -> None:
    skeleton = yaml.safe_load((rom / "truth" / "skeleton.yaml").read_text())
    origin = {name: np.array(joint["offset_in_parent"]) for name, joint in skeleton.items()}
    errors = {}
    for bone in calibrated.diagnosis.bones:
        start = origin[bone.start] if skeleton[bone.start]["parent"] == bone.segment else np.zeros(3)
        errors[bone.start, bone.end] = abs(bone.length_m - float(np.linalg.norm(origin[bone.end] - start)))
    assert len(errors) >= 11
    assert np.mean(list(errors.values())) < 0.005, errors
    assert max(errors.values()) < 0.012, errors


def test_joints_are_where_they_are_in_the_cameras(calibrated: CalibratedBody, rom: Path) -> None:
    errors = joint_errors_in_cameras(calibrated.body, rom)
    assert len(errors) == 34
    assert np.mean(errors) < 0.008


def test_knees_and_elbows_are_hinges_and_nothing_else(calibrated: CalibratedBody) -> None:
    hinges = {joint.name for joint in calibrated.diagnosis.joints if joint.freedom == "hinge"}
    assert hinges == {"knee_left", "knee_right", "elbow_left", "elbow_right"}
    for joint in calibrated.diagnosis.joints:
        if joint.axis is not None:
            assert abs(joint.axis[1]) > 0.998, "a knee bends about the line from right to left"


def test_nothing_slipped(calibrated: CalibratedBody) -> None:
    assert all(camera.slipped_s is None for camera in calibrated.diagnosis.cameras)


def test_the_walk_is_solved_with_it(calibrated: CalibratedBody, shared: Path, sample: Path, tmp_path: Path) -> None:
    write_body(calibrated.body, tmp_path / "body.yaml")
    out, walk = tmp_path / "out", shared / "dev_walk"
    replay(walk / "bag", sample / "map", tmp_path / "body.yaml", out, PipelineSettings(), JOBS)
    found = compare(read_solved(out), read_true_motion(walk))
    assert found.coverage > 0.98
    assert found.position_errors.mean() < 0.010
    assert np.degrees(np.mean([joint.rotation_errors.mean() for joint in found.joints.values()])) < 0.8
