from pathlib import Path

import pytest
from talos import MAPPING

from bodycam_ros.errors import BodyError
from bodycam_ros.robot.mapping import read_mapping


def test_the_mapping_of_talos_names_its_limbs() -> None:
    mapping = read_mapping(MAPPING)
    assert mapping.root == "base_link" and mapping.trunk == "torso_2_link"
    assert mapping.legs["left"] == ("leg_left_3_link", "leg_left_4_link", "leg_left_6_link", "left_sole_link")
    assert mapping.arms["right"] == ("arm_right_2_link", "arm_right_4_link", "arm_right_7_link")
    assert 0.0 < mapping.feet_apart < 0.1


@pytest.mark.parametrize(
    ("change", "complaint"),
    [
        (("root: base_link\n", ""), "mapping: lacks root"),
        (("hip:", "hips:"), "legs: left: lacks hip"),
        (("  right: {hip", "  middle: {hip"), "legs: lacks right"),
        (("trunk: torso_2_link", "trunk: 3"), "trunk must be a name"),
        (("feet_apart: 0.045", "feet_apart: 4.5"), "feet_apart must be a number from 0 to 0.3"),
        (("trunk:", "n_pose: {arm: wide}\ntrunk:"), "n_pose: arm must be a number"),
    ],
)
def test_what_is_wrong_is_named_with_its_file(tmp_path: Path, change: tuple[str, str], complaint: str) -> None:
    path = tmp_path / "robot.yaml"
    text = MAPPING.read_text()
    assert change[0] in text
    path.write_text(text.replace(*change, 1))
    with pytest.raises(BodyError, match=f"robot.yaml: {complaint}"):
        read_mapping(path)
