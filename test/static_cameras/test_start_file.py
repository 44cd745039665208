"""A person placed by hand: what a start file says, and a whole body as near to it as joints allow."""

import logging
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml
from helpers.naming import naming

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array, exp_se3, exp_so3, inverse, log_se3, quaternion_xyzw
from bodycam_ros.static_cameras.start_file import AUTO, NONE, StaticCameraFiles, read_start, start_poses

NOISE = np.repeat([np.radians(6.0), 0.03], 3) / np.sqrt(3.0)


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return read_body(sample / "body.yaml")


@pytest.fixture
def written(tmp_path: Path) -> Callable[[Any], Path]:
    def write(document: Any) -> Path:
        path = tmp_path / "start.yaml"
        path.write_text(document if isinstance(document, str) else yaml.safe_dump(document))
        return path

    return write


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(4)


def line(pose: Array) -> list[float]:
    return [*pose[:3, 3].tolist(), *quaternion_xyzw(pose[:3, :3]).tolist()]


def bent(body: BodyModel, rng: np.random.Generator) -> Array:
    """A pose (S, 4, 4) of a body, every joint turned by some 25 deg in what its type permits."""
    turns = exp_so3(rng.normal(0.0, 0.25, (len(body.tree_joints), 3)))
    turns = np.stack([joint.permitted_rotation(R) for joint, R in zip(body.tree_joints, turns, strict=True)])
    return body.forward_kinematics(exp_se3(np.array([0.2, -0.1, 2.0, 1.5, -0.7, 1.0])), turns)


def n_pose(body: BodyModel, world_T_root: Array) -> Array:
    return body.forward_kinematics(world_T_root, np.tile(np.eye(3), (len(body.tree_joints), 1, 1)))


def named(body: BodyModel, poses: Array) -> dict[str, Array]:
    return dict(zip(body.segments, poses, strict=True))


def largest_gap(body: BodyModel, poses: Array) -> float:
    placed = named(body, poses)
    ends = [(placed[j.parent] @ j.parent_T_joint, placed[j.child] @ j.child_T_joint) for j in body.tree_joints]
    return max(float(np.linalg.norm(one[:3, 3] - other[:3, 3])) for one, other in ends)


def test_what_is_written_is_read(body: BodyModel, written: Callable[[Any], Path], rng: np.random.Generator) -> None:
    poses = named(body, bent(body, rng))
    path = written({"shin_left": line(poses["shin_left"]), "pelvis": line(poses["pelvis"])})
    placed = read_start(path, body)
    assert set(placed) == {"pelvis", "shin_left"}
    for segment, pose in placed.items():
        np.testing.assert_allclose(pose, poses[segment], atol=1e-9)


def test_hands_that_the_body_does_not_have_are_left_out_and_named(
    body: BodyModel, written: Callable[[Any], Path], caplog: pytest.LogCaptureFixture
) -> None:
    nowhere = [0, 0, 1, 0, 0, 0, 1]
    with caplog.at_level(logging.WARNING):
        placed = read_start(written({"hand_left": nowhere, "pelvis": nowhere, "hand_right": "lost"}), body)
    assert list(placed) == ["pelvis"]
    (record,) = caplog.records
    assert "hand_left, hand_right" in record.getMessage()


@pytest.mark.parametrize(
    ("document", "named"),
    [
        ("", ()),
        ("pelvis: [", ()),
        ({}, ("subject",)),
        ({"hand_left": [0, 0, 0, 0, 0, 0, 1], 7: 7}, ("hand_left, 7",)),
        ({"pelvis": [0, 0, 1, 0, 0, 0]}, ("segment pelvis",)),
        ({"pelvis": "0000001"}, ("segment pelvis",)),
        ({"pelvis": [0, 0, float("nan"), 0, 0, 0, 1]}, ("segment pelvis",)),
        ({"pelvis": [0, 0, 1, 0, 0, 0, 0]}, ("segment pelvis",)),
        ({"pelvis": [0, 0, 1040, 0, 0, 0, 1]}, ("segment pelvis",)),
    ],
)
def test_what_is_wrong_is_said_with_file_and_segment(
    body: BodyModel, written: Callable[[Any], Path], document: Any, named: tuple[str, ...]
) -> None:
    path = written(document)
    with naming(BodyError, path, *named):
        read_start(path, body)


@pytest.mark.parametrize(
    ("start", "keypoints", "counting"),
    [
        (AUTO, None, AUTO), (AUTO, NONE, None), (AUTO, Path("pose"), Path("pose")), (Path("start.yaml"), None, None),
        (Path("start.yaml"), AUTO, AUTO), (None, Path("pose"), Path("pose")),
    ],
)  # fmt: skip
def test_a_detected_start_has_detected_keypoints_unless_others_or_none_are_given(
    start: Path | None, keypoints: Path | None, counting: Path | None
) -> None:
    assert StaticCameraFiles(Path("cameras.yaml"), start=start, keypoints=keypoints).evidence == counting


def test_without_noise_the_body_is_where_it_was_placed(body: BodyModel, rng: np.random.Generator) -> None:
    true = bent(body, rng)
    np.testing.assert_allclose(start_poses(body, named(body, true)), true, atol=1e-8)


def test_joints_take_from_what_each_segment_is_off(body: BodyModel, rng: np.random.Generator) -> None:
    true = bent(body, rng)
    before, after = [], []
    for _ in range(10):
        placed = true @ exp_se3(rng.normal(size=(len(true), 6)) * NOISE)
        poses = start_poses(body, named(body, placed))
        assert largest_gap(body, poses) < 1e-9
        before.append(log_se3(inverse(true) @ placed))
        after.append(log_se3(inverse(true) @ poses))
    rms = [np.sqrt(np.mean(np.square(off).reshape(-1, 2, 3).sum(axis=2), axis=0)) for off in (before, after)]
    np.testing.assert_allclose(rms[0], [np.radians(6.0), 0.03], rtol=0.1)
    # Of head, forearms and feet no joint tells how they are turned.
    assert rms[1][0] < 0.92 * rms[0][0] and rms[1][1] < 0.7 * rms[0][1]


def test_one_segment_alone_makes_the_n_pose(body: BodyModel) -> None:
    stands = exp_se3(np.array([0.0, 0.1, 1.3, 2.0, -3.0, 1.0]))
    expected = n_pose(body, stands)
    np.testing.assert_allclose(start_poses(body, {"pelvis": stands}), expected, atol=1e-9)
    shin = body.segment_index["shin_left"]
    np.testing.assert_allclose(start_poses(body, {"shin_left": expected[shin]}), expected, atol=1e-8)
