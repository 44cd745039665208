"""A map of what body cameras saw, from the command line: it agrees with the map that photographs of the place make."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest
import yaml

from bodycam_ros.cli.main import main
from bodycam_ros.registration.matching import match_near_prediction
from bodycam_ros.registration.pose_fit import PoseFitSettings, fit_pose
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings

pytestmark = pytest.mark.long

QUICK = ["--frames.most", "24", "--features.max_features", "900"]
BAGS = Path(__file__).parents[2] / "bags"


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, str]:
    """The map of the sample's range of motion, and what the command printed."""
    path = tmp_path_factory.mktemp("worn") / "map"
    inputs = ["--from-bag", BAGS / "rom/bag", "--rig", BAGS / "rom/rig.yaml", "--board", BAGS / "reference/board.yaml"]
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "map", *map(str, inputs), "-o", str(path), *QUICK]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return path, done.stdout


def test_keyframes_of_all_cameras_are_its_photographs(built: tuple[Path, str]) -> None:
    path, printed = built
    made = ReferenceMap.load(path)
    assert made.metric and made.gravity_aligned
    assert "metric, by the board" in printed and "z is up, from the board" in printed
    cameras = ("shin_left", "thigh_left", "thigh_right", "waist_front")
    assert {name.rsplit("_", 1)[0] for name in made.image_names} == set(cameras)
    assert 16 <= len(made.image_names) <= 28
    assert made.photographs is not None and len(made.photographs.cameras) == 4
    for name, row in zip(made.image_names, made.photographs.camera_of_view, strict=True):
        assert cameras[row] == name.rsplit("_", 1)[0]
    summary = yaml.safe_load((path / "map.yaml").read_text())
    assert set(summary["cameras"]) == set(cameras) and summary["reference"] == "bag"


def test_keyframes_stand_where_the_map_of_photographs_puts_them(built: tuple[Path, str]) -> None:
    made, reference = ReferenceMap.load(built[0]), ReferenceMap.load(BAGS / "map")
    assert made.photographs is not None
    detector = KeypointDetector(KeypointSettings(image_scale=1.0, max_keypoints=1500))
    apart, turned = [], []
    for row in range(0, len(made.world_T_camera), 2):
        pose = made.world_T_camera[row]
        camera = made.photographs.cameras[made.photographs.camera_of_view[row]]
        picture = cv2.imdecode(np.frombuffer(made.photographs.jpegs[row], np.uint8), cv2.IMREAD_GRAYSCALE)
        found = detector.detect(np.asarray(picture, np.uint8), np.full(picture.shape, 255, np.uint8))
        features, landmarks = match_near_prediction(
            reference, camera, pose, found.pixels, found.descriptors, found.scales, 20.0
        )
        points, pixels = reference.points_world[landmarks], found.pixels[features].astype(np.float64)
        fit = fit_pose(camera, points, pixels, pose, PoseFitSettings()) if len(points) > 30 else None
        if fit is not None and fit.inliers.sum() > 30:
            other = fit.world_T_camera
            apart.append(np.linalg.norm(other[:3, 3] - pose[:3, 3]))
            cosine = 0.5 * (np.trace(other[:3, :3].T @ pose[:3, :3]) - 1.0)
            turned.append(np.degrees(np.arccos(np.clip(cosine, -1.0, 1.0))))
    assert len(apart) >= 4
    assert np.median(apart) < 0.02 and np.median(turned) < 0.4


def expect_error(arguments: list[object], capsys: pytest.CaptureFixture[str], *words: str) -> None:
    assert main(["map", *map(str, arguments)]) == 1
    message = capsys.readouterr().err
    assert "Traceback" not in message
    for word in words:
        assert word in message.replace("\n", " "), message


def test_what_does_not_go_together_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out = ["-o", tmp_path / "map"]
    worn = ["--from-bag", BAGS / "rom/bag", "--rig", BAGS / "rom/rig.yaml"]
    expect_error(out, capsys, "nothing to make a map from", "--from-bag")
    expect_error([BAGS / "reference", *worn, *out], capsys, "give either")
    expect_error([BAGS / "reference", "--rig", BAGS / "rom/rig.yaml", *out], capsys, "--rig", "--from-bag")
    distance = ["--known-distance", "thigh_left", "thigh_right"]
    expect_error([BAGS / "reference", *distance, "0.3", *out], capsys, "--known-distance", "--from-bag")
    expect_error([*worn, *distance, "0.3", *out], capsys, "different segments", "rig.yaml")
    no_camera = ["--known-distance", "left_ear", "right_ear"]
    expect_error([*worn, *no_camera, "0.2", *out], capsys, "rig.yaml has no camera left_ear", "thigh_left")
    expect_error([*worn[:2], *distance, "wide", *out], capsys, "number of metres")
    expect_error([*worn[:2], *distance, "0", *out], capsys, "from 0.01 to 10")
    expect_error([*worn[:2], "--known-distance", "left_ear", "thigh_left", "0.2", *out], capsys, "no camera left_ear")
    assert not (tmp_path / "map").exists()
