"""A start by the keypoints of static cameras, in the layouts that people have."""

import json
from collections.abc import Mapping
from pathlib import Path

import numpy as np
import pytest
from static_cameras.dressed_body import static_cameras_around

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.keypoints import JOINTS, read_keypoints
from bodycam_ros.formats.read_captured import read_start
from bodycam_ros.geometry import Array, exp_so3, inverse, rigid, transform_points
from bodycam_ros.static_cameras.blazepose import LANDMARKS
from bodycam_ros.static_cameras.start_file import AUTO
from bodycam_ros.static_cameras.static_camera import StaticCamera

KINDS = {"Shoulder": "upper_arm", "Elbow": "forearm", "Wrist": "hand", "Hip": "thigh", "Knee": "shin", "Ankle": "foot"}
SIDES = {"L": "left", "R": "right"}
COCO = ["LShoulder", "RShoulder", "LElbow", "RElbow", "LWrist", "RWrist", "LHip", "RHip", "LKnee", "RKnee", "LAnkle",
        "RAnkle"]  # fmt: skip
BODY_25 = ["Nose", "Neck", "RShoulder", "RElbow", "RWrist", "LShoulder", "LElbow", "LWrist", "MidHip", "RHip", "RKnee",
           "RAnkle", "LHip", "LKnee", "LAnkle"]  # fmt: skip
LAYOUTS = {
    "COCO-17": [""] * 5 + COCO,
    "BODY_25": BODY_25 + [""] * 10,
    "HALPE_26": [""] * 5 + COCO + [""] * 9,
    "COCO-133": [""] * 5 + COCO + [""] * 116,
}


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return with_hands(read_body(sample / "body.yaml"))


def pose_of(body: BodyModel, x: float, turn: float) -> Array:
    return body.n_pose(rigid(exp_so3(np.array([0.0, 0.0, turn])), np.array([x, -0.2, 0.95])))


def write(
    folder: Path, body: BodyModel, people: list[Array], layout: list[str], suffix: str = "_json", lie: str = ""
) -> Mapping[str, StaticCamera]:
    """Keypoints of people in the first image of four cameras, a pixel off; one camera has left for right."""
    stations = static_cameras_around(4)
    random = np.random.default_rng(3)
    for name, station in stations.items():
        shown = []
        for poses in people[:: -1 if name.endswith("2") else 1]:
            values = np.zeros((len(layout), 3))
            for row, joint in enumerate(layout):
                if joint not in JOINTS:
                    continue
                side = joint[0] if name != lie else {"L": "R", "R": "L"}[joint[0]]
                at = poses[body.segment_index[f"{KINDS[joint[1:]]}_{SIDES[side]}"], :3, 3]
                pixels, _ = station.camera.project(transform_points(inverse(station.world_T_camera), at[None]))
                values[row] = [*(pixels[0] + random.normal(0.0, 1.0, 2)), 0.9]
            shown.append({"pose_keypoints_2d": values.ravel().tolist()})
        place = folder / f"{name}{suffix}"
        place.mkdir(parents=True)
        (place / "img_000000.json").write_text(json.dumps({"version": 1.3, "people": shown}))
    return stations


@pytest.mark.parametrize("layout", LAYOUTS)
def test_a_person_is_found_by_every_layout(body: BodyModel, tmp_path: Path, layout: str) -> None:
    true = pose_of(body, 0.3, 0.7)
    stations = write(tmp_path / "pose", body, [true], LAYOUTS[layout])
    placed = read_start(tmp_path / "pose", tmp_path / "cameras.yaml", stations, body)
    assert not placed.unplaced.any()
    off = np.linalg.norm(placed.world_T_segment[:, :3, 3] - true[:, :3, 3], axis=1)
    limbs = [body.segment_index[f"{kind}_{side}"] for kind in KINDS.values() for side in SIDES.values()]
    assert off[limbs].max() < 0.05


def test_each_of_two_people_is_found_although_cameras_list_them_otherwise(body: BodyModel, tmp_path: Path) -> None:
    both = [pose_of(body, 0.4, 0.7), pose_of(body, -0.6, 2.0)]
    stations = write(tmp_path / "pose", body, both, LAYOUTS["HALPE_26"])
    rows = [body.segment_index[name] for name in ("foot_left", "hand_right", "thigh_left", "shin_right")]
    off = np.array([[np.inf, np.inf]] * 2)
    for person in (1, 2):
        placed = read_start(tmp_path / "pose", tmp_path / "cameras.yaml", stations, body, person).world_T_segment
        off[person - 1] = [np.linalg.norm(placed[rows, :3, 3] - true[rows, :3, 3], axis=1).max() for true in both]
    assert (off.min(axis=1) < 0.05).all() and set(off.argmin(axis=1).tolist()) == {0, 1}
    with pytest.raises(BodyError) as refused:
        read_start(tmp_path / "pose", tmp_path / "cameras.yaml", stations, body, 3)
    assert "2 people" in str(refused.value) and "--person is 3" in str(refused.value)


def test_a_person_found_twice_is_one_person(body: BodyModel, tmp_path: Path) -> None:
    true = pose_of(body, 0.4, 0.7)
    stations = write(tmp_path / "pose", body, [true, true], LAYOUTS["HALPE_26"])
    with pytest.raises(BodyError) as refused:
        read_start(tmp_path / "pose", tmp_path / "cameras.yaml", stations, body, 2)
    assert "1 people" in str(refused.value)


def test_detected_people_are_a_start(body: BodyModel, tmp_path: Path) -> None:
    true = pose_of(body, 0.3, 0.7)
    stations = write(tmp_path / "pose", body, [true], LAYOUTS["COCO-17"])
    people = read_keypoints(tmp_path / "pose", stations, 1)
    placed = read_start(AUTO, tmp_path / "cameras.yaml", stations, body, 1, people).world_T_segment
    rows = [body.segment_index[name] for name in ("foot_left", "hand_right", "thigh_left", "shin_right")]
    assert np.linalg.norm(placed[rows, :3, 3] - true[rows, :3, 3], axis=1).max() < 0.05


def test_a_start_that_cannot_be_detected_is_refused(body: BodyModel, tmp_path: Path) -> None:
    stations = static_cameras_around(4)
    with pytest.raises(BodyError) as refused:
        read_start(AUTO, tmp_path / "cameras.yaml", stations, body)
    assert "bodycam view --place" in str(refused.value)
    nobody: dict[str, list[list[Array]]] = {name: [[]] for name in stations}
    with pytest.raises(BodyError) as refused:
        read_start(AUTO, tmp_path / "cameras.yaml", stations, body, 1, nobody)
    assert f"nobody at all was found before {[*stations][0]}" in str(refused.value)


def test_a_start_of_one_person_has_no_second(body: BodyModel, tmp_path: Path) -> None:
    (tmp_path / "start.yaml").write_text("pelvis: [0, 0, 1, 0, 0, 0, 1]\n")
    with pytest.raises(BodyError) as refused:
        read_start(tmp_path / "start.yaml", tmp_path / "cameras.yaml", static_cameras_around(4), body, 2)
    assert "start.yaml" in str(refused.value) and "--person" in str(refused.value)


def test_detected_keypoints_are_in_the_order_of_those_in_files() -> None:
    # https://github.com/google-ai-edge/mediapipe/blob/v0.10.21/mediapipe/python/solutions/pose.py
    names = {11: "LShoulder", 12: "RShoulder", 13: "LElbow", 14: "RElbow", 15: "LWrist", 16: "RWrist", 23: "LHip",
             24: "RHip", 25: "LKnee", 26: "RKnee", 27: "LAnkle", 28: "RAnkle"}  # fmt: skip
    assert tuple(names[row] for row in LANDMARKS) == JOINTS


def test_a_limb_without_keypoints_is_searched_for(body: BodyModel, tmp_path: Path) -> None:
    layout = [name if name not in ("LElbow", "LWrist") else "" for name in LAYOUTS["COCO-17"]]
    stations = write(tmp_path / "pose", body, [pose_of(body, 0.3, 0.7)], layout)
    placed = read_start(tmp_path / "pose", tmp_path / "cameras.yaml", stations, body)
    named = {name for name, out in zip(body.segments, placed.unplaced, strict=True) if out}
    assert named == {"forearm_left", "hand_left"}


def test_a_camera_that_takes_left_for_right_is_rejected(body: BodyModel, tmp_path: Path) -> None:
    true = pose_of(body, 0.3, 0.7)
    liar = [*static_cameras_around(4)][1]
    stations = write(tmp_path / "pose", body, [true], LAYOUTS["COCO-17"], lie=liar)
    placed = read_start(tmp_path / "pose", tmp_path / "cameras.yaml", stations, body).world_T_segment
    rows = [body.segment_index[name] for name in ("foot_left", "foot_right", "hand_left", "hand_right")]
    assert np.linalg.norm(placed[rows, :3, 3] - true[rows, :3, 3], axis=1).max() < 0.05


def test_what_is_wrong_is_named(body: BodyModel, tmp_path: Path) -> None:
    stations = write(tmp_path / "pose", body, [pose_of(body, 0.3, 0.7)], LAYOUTS["COCO-17"])
    first = next((tmp_path / "pose").glob("*/*.json"))
    first.write_text('{"people": [{"pose_keypoints_2d": [1, 2, 3]}]}')
    with pytest.raises(BodyError, match=r"json: expected JSON of OpenPose.*1 keypoints a person; known are 17"):
        read_start(tmp_path / "pose", tmp_path / "cameras.yaml", stations, body)
    write(tmp_path / "other", body, [pose_of(body, 0.3, 0.7)], LAYOUTS["COCO-17"])
    alone = dict([*stations.items()][:1])
    with pytest.raises(BodyError, match="expected a folder of JSON files for two cameras or more"):
        read_start(tmp_path / "other", tmp_path / "cameras.yaml", alone, body)


def test_nobody_in_the_images_is_named(body: BodyModel, tmp_path: Path) -> None:
    stations = write(tmp_path / "pose", body, [], LAYOUTS["COCO-17"])
    with pytest.raises(BodyError, match="no two cameras agree on five joints of one person"):
        read_start(tmp_path / "pose", tmp_path / "cameras.yaml", stations, body)
