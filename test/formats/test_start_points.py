"""A start by joint points of another system, whatever its names, axes and unit."""

from pathlib import Path

import numpy as np
import pytest
from helpers.naming import naming
from static_cameras.dressed_body import static_cameras_around

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.read_captured import read_joint_points
from bodycam_ros.formats.start_points import place_points
from bodycam_ros.geometry import Array, exp_so3, rigid

NAMES = {"thigh": "Hip", "shin": "Knee", "foot": "Ankle", "upper_arm": "Shoulder", "forearm": "Elbow", "hand": "Wrist"}
SIDES = {"left": ("L", "left_", "l.", "L"), "right": ("R", "right_", "r.", "R")}
PLUG_IN_GAIT = {"thigh": "HJC", "shin": "KJC", "foot": "AJC", "upper_arm": "SJC", "forearm": "EJC", "hand": "WJC"}


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return with_hands(read_body(sample / "body.yaml"))


def points_of(body: BodyModel, poses: Array, style: int) -> dict[str, Array]:
    points = {"Nose": np.full((1, 3), 9.0), "RHip_study": np.full((1, 3), 7.0)}
    for segment, pose in zip(body.segments, poses, strict=True):
        kind, _, side = segment.rpartition("_")
        if kind in NAMES:
            word = PLUG_IN_GAIT[kind] if style == 3 else NAMES[kind] if style == 0 else NAMES[kind].lower()
            points[SIDES[side][style] + word] = pose[None, :3, 3]
    return points


@pytest.mark.parametrize("style", [0, 1, 2, 3])
@pytest.mark.parametrize("unit", [1.0, 0.001])
@pytest.mark.parametrize("quarter", [0, 1])
def test_a_standing_body_is_found(body: BodyModel, style: int, unit: float, quarter: int) -> None:
    stations = static_cameras_around(4)
    true = body.n_pose(rigid(exp_so3(np.array([0.0, 0.0, 0.7])), np.array([0.3, -0.2, 0.95])))
    turn = exp_so3(np.array([0.0, 0.0, quarter * np.pi / 2.0]))
    points = {name: row @ turn / unit for name, row in points_of(body, true, style).items()}
    found = place_points(Path("p.trc"), points, body, stations.values())
    legs = [body.segment_index[name] for name in ("pelvis", "shin_left", "foot_right", "hand_left")]
    # Cameras around a person see it from all sides: its place tells the turn only where it is off the middle.
    assert np.linalg.norm(np.linalg.norm(found[legs, :2, 3], axis=1) - np.linalg.norm(true[legs, :2, 3], axis=1)) < 0.05
    np.testing.assert_allclose(found[legs, 2, 3], true[legs, 2, 3], atol=0.03)


@pytest.mark.parametrize(
    ("name", "segment"),
    [("Neck", "head"), ("midhip", "pelvis"), ("Pelvis", "pelvis"), ("head", ""), ("Nose", ""), ("RHeel", "")],
)
def test_points_of_the_trunk_and_markers(body: BodyModel, name: str, segment: str) -> None:
    """A point that counts makes the fifth of those that are needed; a head's point is its middle, and not its joint."""
    poses = body.n_pose(rigid(np.eye(3), np.array([0.0, 0.0, 0.95])))
    points = {each: rows for each, rows in points_of(body, poses, 0).items() if "Hip" in each or "Knee" in each}
    place = poses[body.segment_index[segment or "head"], :3, 3]
    points = {each: rows for each, rows in points.items() if "study" not in each} | {name: place[None]}
    stations = static_cameras_around(2).values()
    if segment:
        place_points(Path("p.trc"), points, body, stations)
    else:
        with naming(BodyError, "p.trc"):
            place_points(Path("p.trc"), points, body, stations)


def test_csv_has_a_column_for_each_axis(tmp_path: Path) -> None:
    path = tmp_path / "points.csv"
    path.write_text("time,LHip_x,LHip_y,LHip_z,RKnee.X,RKnee.Y,RKnee.Z\n0,1,2,3,4,,6\n1,7,8,9,1,2,3\n")
    points = read_joint_points(path)
    assert points is not None and set(points) == {"LHip", "RKnee"}
    np.testing.assert_array_equal(points["LHip"], [[1, 2, 3], [7, 8, 9]])
    np.testing.assert_array_equal(points["RKnee"], [[np.nan] * 3, [1, 2, 3]])
    assert read_joint_points(tmp_path / "start.yaml") is None


def test_points_that_are_no_joints_are_refused_with_their_names(body: BodyModel) -> None:
    with naming(BodyError, "p.trc", "Toe"):
        place_points(Path("p.trc"), {"Toe": np.zeros((1, 3))}, body, static_cameras_around(2).values())
