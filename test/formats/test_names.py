"""What other systems call joints and markers, and what a user's table says instead."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.errors import RecordingError
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.point_sites import locate_points

SIDED = ("thigh", "shin", "foot", "upper_arm", "forearm")
LINKS = ("pelvis", "torso", "head", *(f"{kind}_{side}" for side in ("left", "right") for kind in SIDED))
JOINTS = {"spine": "torso", "hip_left": "thigh_left", "knee_left": "shin_left"}


def captured(*names: str) -> CapturedMotion:
    points = np.ones((2, 3))
    return CapturedMotion(Path("other.trc"), "TRC", np.arange(2), dict.fromkeys(names, points))


def found(*names: str, table: Path | None = None, turning: str = "") -> dict[str, tuple[str, bool]]:
    motion = replace(captured(*names), rotations={turning: np.tile(np.eye(3), (2, 1, 1))})
    places = locate_points(motion, [*LINKS, "waist_optical_frame"], JOINTS, table)
    return {name: (place.link, place.is_fitted) for name, place in places.items()}


@pytest.mark.parametrize(
    ("left", "right", "segment"),
    [
        ("mixamorig:LeftUpLeg", "mixamorig:RightUpLeg", "thigh"),
        ("LeftLeg", "RightLeg", "shin"),
        ("ltibia", "rtibia", "shin"),
        ("lradius", "rradius", "forearm"),
        ("femur_l", "femur_r", "thigh"),
        ("L.HJC", "R.HJC", "thigh"),
        ("LShoulder", "RShoulder", "upper_arm"),
        ("lowerarm_l", "lowerarm_r", "forearm"),
        ("Left_knee", "Right_knee", "shin"),
        ("LAnkle", "RAnkle", "foot"),
        ("forearm.L", "forearm.R", "forearm"),
        ("Subject1:LeftForeArm", "Subject1:RightForeArm", "forearm"),
        ("thigh_left", "thigh_right", "thigh"),
    ],
)
def test_centres_of_joints_are_known(left: str, right: str, segment: str) -> None:
    assert found(left, right) == {left: (f"{segment}_left", False), right: (f"{segment}_right", False)}


@pytest.mark.parametrize(
    ("name", "segment"),
    [
        ("LASI", "pelvis"),
        ("RPSI", "pelvis"),
        ("V.Sacral", "pelvis"),
        ("LKNE", "thigh_left"),
        ("R.Knee.Lat", "thigh_right"),
        ("RTIB", "shin_right"),
        ("LANK", "shin_left"),
        ("LHEE", "foot_left"),
        ("RBigToe", "foot_right"),
        ("C7", "torso"),
        ("RSHO", "torso"),
        ("LELB", "upper_arm_left"),
        ("RWRA", "forearm_right"),
        ("LFHD", "head"),
        ("Hips", "pelvis"),
        ("Head", "head"),
    ],
)
def test_of_markers_the_segment_is_known(name: str, segment: str) -> None:
    assert found(name) == {name: (segment, True)}


def test_a_shoulder_beside_an_arm_is_the_collar_bone() -> None:
    assert found("LeftShoulder", "LeftArm") == {"LeftArm": ("upper_arm_left", False)}
    assert found("LeftShoulder") == {"LeftShoulder": ("upper_arm_left", False)}


def test_our_own_names_are_exact_and_cameras_are_known() -> None:
    assert found("waist", "pelvis") == {"pelvis": ("pelvis", False)}  # a marker that is named as a camera is
    assert found("spine", "pelvis", "hip_left", "thigh_left_front", "waist", turning="waist") == {
        "spine": ("torso", False),
        "pelvis": ("pelvis", False),
        "hip_left": ("thigh_left", False),
        "thigh_left_front": ("thigh_left", True),
        "waist": ("waist_optical_frame", False),
    }


def test_a_table_says_otherwise(tmp_path: Path) -> None:
    table = tmp_path / "names.yaml"
    table.write_text("M1: knee_left\nLKNE: shin_left\nM2: head\nM3: waist\nC7:\n")
    assert found("M1", "M2", "M3", "LKNE", "C7", "RKNE", table=table) == {
        "M1": ("shin_left", False),
        "M2": ("head", True),
        "M3": ("waist_optical_frame", False),
        "LKNE": ("shin_left", True),
        "RKNE": ("thigh_right", True),
    }


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("[a]", ("names.yaml",)),
        ("M9: head", ("other.trc", "M9", "M1")),
        ("M1: tail", ("tail",)),
        ("M1: {at: [0, 0, 0]}", ("at",)),
    ],
)
def test_a_table_that_does_not_fit_is_named(tmp_path: Path, text: str, named: tuple[str, ...]) -> None:
    (tmp_path / "names.yaml").write_text(text)
    with naming(RecordingError, *named):
        found("M1", table=tmp_path / "names.yaml")


def test_names_that_nobody_knows_are_told_with_the_way_out() -> None:
    with naming(RecordingError, "M1", "M2", "--points"):
        found("M1", "M2")
