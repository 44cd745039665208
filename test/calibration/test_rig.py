"""What a user says of cameras and segments, and the slips of a pen in it."""

from pathlib import Path

import pytest
from helpers.naming import naming

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import BodyError

GOOD = "cameras: {waist: pelvis, thigh: thigh_left}\nsegments: {pelvis: null, thigh_left: pelvis, hand_left: pelvis}\n"


def test_a_rig_is_read_and_what_carries_no_camera_is_left_out(tmp_path: Path) -> None:
    (tmp_path / "rig.yaml").write_text(GOOD)
    rig = Rig.from_yaml(tmp_path / "rig.yaml")
    assert rig.root == "pelvis"
    assert rig.segments == ("pelvis", "thigh_left")
    assert rig.cameras_on("thigh_left") == ("thigh",)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("cameras: {}\nsegments: {pelvis: null}", ("camera",)),
        ("cameras: {a: arm}\nsegments: {pelvis: null}", ("arm",)),
        ("cameras: {a: x}\nsegments: {r: null, x: y, y: x}", ("x", "y")),
        ("cameras: {a: pelvis, b: head}\nsegments: {pelvis: null, torso: pelvis, head: torso}", ("torso",)),
        (GOOD.replace("thigh: thigh_left", "thigh: thigh_lefd"), ("thigh_lefd", "did you mean thigh_left?")),
        (GOOD.replace("hand_left: pelvis", "hand_left: pelvs"), ("pelvs", "did you mean pelvis?")),
        ("cameras: {a: x}\nsegments: {x: y, y: x}", ("null", "root")),
        ("cameras: {a: x}\nsegments: {x: null, y: null}", ("root", "x, y")),
        ("cameras: {a: pelvis}", ("segments",)),
        ("cameras: {a: pelvis", ()),
    ],
)
def test_what_is_wrong_is_said_with_the_files_name(tmp_path: Path, text: str, named: tuple[str, ...]) -> None:
    path = tmp_path / "rig.yaml"
    path.write_text(text)
    with naming(BodyError, path, *named):
        Rig.from_yaml(path)
