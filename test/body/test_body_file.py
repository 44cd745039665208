from pathlib import Path

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.checked_fields import Entry, read_entry
from bodycam_ros.errors import BodyError

STOOL = """
name: stool
root: foot
segments: [foot, seat]
joints:
  post: {parent: foot, child: seat, type: hinge, origin_in_parent: [0, 0, 5e-1], axis: [0, 0, 2], limits: [-1.5, 1.5]}
cameras:
  under: {segment: seat, position: [0.1, 0, 0], quaternion_xyzw: [0, 0, 0, 1.0005]}
"""


def read(tmp_path: Path, text: str) -> BodyModel:
    path = tmp_path / "stool.yaml"
    path.write_text(text)
    return read_body(path)


def test_what_a_person_writes_is_understood(tmp_path: Path) -> None:
    body = read(tmp_path, STOOL)
    post = body.joints[0]
    np.testing.assert_allclose(post.parent_T_joint[:3, 3], [0.0, 0.0, 0.5])
    np.testing.assert_allclose(post.axis, [0.0, 0.0, 1.0])
    assert post.limits == ((-1.5, 1.5),)
    # A quaternion that is a little long is normalised.
    np.testing.assert_allclose(body.mounts["under"].segment_T_camera[:3, :3], np.eye(3), atol=1e-12)


def test_written_and_read_again_is_the_same_body(body: BodyModel, tmp_path: Path) -> None:
    path = tmp_path / "rider.yaml"
    write_body(body, path)
    again = read_body(path)
    assert (again.name, again.root, again.segments, again.report) == (body.name, body.root, body.segments, body.report)
    for joint, same in zip(body.joints, again.joints, strict=True):
        for plain in ("name", "parent", "child", "type", "sigmas", "limits"):
            assert getattr(same, plain) == getattr(joint, plain)
        np.testing.assert_allclose(same.parent_T_joint, joint.parent_T_joint, atol=3e-9)
        np.testing.assert_allclose(same.child_T_joint, joint.child_T_joint, atol=3e-9)
        if joint.type == "ball":
            assert same.angle_axes == joint.angle_axes
        if joint.type == "hinge":
            np.testing.assert_allclose(same.axis, joint.axis, atol=3e-9)
    assert list(again.mounts) == list(body.mounts)
    for camera, mount in body.mounts.items():
        assert again.mounts[camera].segment == mount.segment
        np.testing.assert_allclose(again.mounts[camera].segment_T_camera, mount.segment_T_camera, atol=3e-9)
    write_body(again, tmp_path / "again.yaml")
    assert (tmp_path / "again.yaml").read_text() == path.read_text()
    assert {file.name for file in tmp_path.iterdir()} == {"rider.yaml", "again.yaml"}


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("root: foot", "", ("root",)),
        ("parent: foot", "parent: fot", ("post", "fot")),
        ("type: hinge", "type: spring", ("post", "type")),
        ("axis: [0, 0, 2], ", "", ("post", "axis")),
        ("[0, 0, 5e-1]", "[0, 0, .nan]", ("post", "origin_in_parent")),
        ("[0, 0, 5e-1]", f"[0, 0, {10**400}]", ("line 6",)),
        ("[0, 0, 0, 1.0005]", "[0, 0, 0, 1.1]", ("under", "quaternion_xyzw")),
        ("1.0005]", "1], readout_time: 12", ("under",)),
        ("1.0005]", "1], readout_sigma: 0.1", ("under", "readout_time")),
        ("cameras:\n", "cameras: []\nreport:\n", ("cameras",)),
        ("  under:", "  under: {}\n  under:", ("under",)),
        ("name: stool", "name: [stool", ()),
    ],
)
def test_a_slip_of_the_pen_is_named_with_its_file(tmp_path: Path, old: str, new: str, named: tuple[str, ...]) -> None:
    assert old in STOOL
    with naming(BodyError, "stool.yaml", *named):
        read(tmp_path, STOOL.replace(old, new, 1))


def test_a_number_is_no_truth_value() -> None:
    class Switch(Entry):
        on: bool = False

    for wrong in ("1", 1, "yes"):
        with naming(BodyError, "here", "on", "bool"):
            read_entry(Switch, {"on": wrong}, "here")
