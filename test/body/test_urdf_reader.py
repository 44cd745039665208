"""Bodies through URDF and back; yourdfpy and Pinocchio read the same documents in test_urdf."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import body_from_urdf, urdf_text
from bodycam_ros.errors import BodyError
from bodycam_ros.kinematics.joint import FULL_TURN

EXACT = 3e-9  # as in a body file


def limited(body: BodyModel) -> BodyModel:
    """With limits on a ball and on a hinge; the others stay without."""
    known = {"hip": ((-0.5, 2.0), (-0.7, 0.8), (-0.4, 0.9)), "knee": ((-0.1, 2.5),)}
    return replace(body, joints=tuple(replace(joint, limits=known.get(joint.name)) for joint in body.joints))


def assert_same_body(again: BodyModel, body: BodyModel) -> None:
    """Equal in all that a URDF carries."""
    joints = (*body.tree_joints, *body.loop_joints)
    assert (again.name, again.root, again.segments) == (body.name, body.root, body.segments)
    assert [joint.name for joint in again.joints] == [joint.name for joint in joints]
    for joint, same in zip(joints, again.joints, strict=True):
        assert (same.parent, same.child, same.type) == (joint.parent, joint.child, joint.type)
        np.testing.assert_allclose(same.parent_T_joint, joint.parent_T_joint, rtol=0.0, atol=EXACT)
        np.testing.assert_allclose(same.child_T_joint, joint.child_T_joint, rtol=0.0, atol=EXACT)
        if joint.type == "hinge":
            np.testing.assert_allclose(same.axis, joint.axis, rtol=0.0, atol=EXACT)
        if joint.type == "ball":
            assert same.angle_axes == joint.angle_axes
        assert (same.limits is None) == (joint.limits is None)
        if joint.limits is not None:
            np.testing.assert_allclose(same.limits, joint.limits, rtol=0.0, atol=EXACT)
    assert list(again.mounts) == list(body.mounts)
    for camera, mount in body.mounts.items():
        assert again.mounts[camera].segment == mount.segment
        np.testing.assert_allclose(again.mounts[camera].segment_T_camera, mount.segment_T_camera, rtol=0.0, atol=EXACT)


def test_a_body_with_everything_comes_back(body: BodyModel) -> None:
    again = body_from_urdf(urdf_text(limited(body)))
    assert_same_body(again, limited(body))
    assert urdf_text(body_from_urdf(urdf_text(again))) == urdf_text(again)


def test_limits_hold_for_every_published_angle_and_soft_limits_are_the_range_of_motion(body: BodyModel) -> None:
    elements = {joint.attrib["name"]: joint for joint in ElementTree.fromstring(urdf_text(limited(body))).iter("joint")}
    for name in ("hip_y", "knee", "ankle_x"):
        limit = elements[name].find("limit")
        assert elements[name].attrib["type"] == "revolute" and limit is not None
        np.testing.assert_allclose([float(limit.attrib[end]) for end in ("lower", "upper")], [-FULL_TURN, FULL_TURN])
    soft = elements["hip_y"].find("safety_controller")
    assert soft is not None and soft.attrib["k_position"] == "0" and "k_velocity" in soft.attrib
    assert (soft.attrib["soft_lower_limit"], soft.attrib["soft_upper_limit"]) == ("-0.5", "2.0")
    assert elements["ankle_x"].find("safety_controller") is None
    for name in ("axle", "cart_z"):
        assert elements[name].attrib["type"] == "continuous"


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("</robot>", "", ()),
        ('<link name="crank">', '<link name="pelvis">', ("crank",)),
        ("parent: crank, child: foot", "parent: crank, child: leg", ("pedal", "leg")),
        ("pedal: {", "pedal: [{", ("<bodycam_body>",)),
        ("bodycam_body>", "other_body>", ("<bodycam_body>",)),
    ],
)  # fmt: skip
def test_what_is_no_body_of_ours_is_named_with_its_file(
    body: BodyModel, tmp_path: Path, old: str, new: str, named: tuple[str, ...]
) -> None:
    text = urdf_text(body)
    assert old in text
    path = tmp_path / "rider.urdf"
    path.write_text(text.replace(old, new, 2 if "body>" in old else 1))
    with naming(BodyError, path, *named):
        read_body(path)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        ("", "XML"),
        ("<sdf/>", "<sdf>"),
        ('<robot name="r"><link name="a"/></robot>', "bodycam_body"),
    ],
)
def test_other_documents_are_refused(text: str, named: str) -> None:
    with naming(BodyError, named):
        body_from_urdf(text)
