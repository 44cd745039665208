"""The command itself, on photographs of the sample."""

import os
import shutil
import signal
import subprocess
import sys
import time

import cv2
import numpy as np
import pycolmap
import pytest
import yaml

from bodycam_ros.boards.apriltag import FAMILIES, detect_tags
from bodycam_ros.boards.board import read_board
from bodycam_ros.cli.main import main
from bodycam_ros.mapping.board_alignment import align_to_board
from bodycam_ros.mapping.photographs import find_photographs
from bodycam_ros.registration.reference_map import ReferenceMap

# Enough for twelve photographs of one floor, and several times faster than the default.
QUICK = ["--features.max_features", "1200", "--jobs", "2"]
NEAR = ["ref_0099.jpg", "ref_0101.jpg", "ref_0103.jpg", "ref_0105.jpg"]


@pytest.fixture(scope="module")
def built(sample, tmp_path_factory):
    """The map of the sample's photographs, as the command line makes it, and what it printed."""
    path = tmp_path_factory.mktemp("built") / "map"
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "map", str(sample / "reference"), "-o", str(path), *QUICK]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return path, done


@pytest.fixture
def few(sample, tmp_path):
    """A folder with four photographs, their calibration and the board's description."""
    folder = tmp_path / "reference"
    folder.mkdir()
    for name in [*NEAR, "camera.yaml", "board.yaml"]:
        shutil.copy(sample / "reference" / name, folder / name)
    return folder


def test_all_photographs_register_and_the_summary_says_so(built, sample):
    path, done = built
    names = [p.name for p in find_photographs(sample / "reference").paths]
    reference_map = ReferenceMap.load(path)
    assert list(reference_map.image_names) == names
    assert reference_map.metric and reference_map.gravity_aligned
    assert f"{len(names)} of {len(names)} photographs registered" in done.stdout
    assert "Traceback" not in done.stderr and "glog" not in done.stderr


def test_a_board_whose_tags_are_exchanged_is_refused(few, tmp_path, capsys):
    """Its fit had the board behind the cameras, with a residual of 0 px and a map that could not be read."""
    board = yaml.safe_load((few / "board.yaml").read_text())
    corners = board["corners_in_board"]
    board["corners_in_board"] = dict(zip(corners, [*list(corners.values())[1:], corners[0]], strict=True))
    (few / "board.yaml").write_text(yaml.safe_dump(board))
    assert main(["map", str(few), "-o", str(tmp_path / "map"), *QUICK]) == 1
    assert "board.yaml" in capsys.readouterr().err
    assert not (tmp_path / "map").exists()


def test_a_photograph_of_another_place_is_left_out_and_named(few, tmp_path, capsys):
    """The first by its name, so that those after it keep their features."""
    like = cv2.imread(str(few / NEAR[0]))
    noise = np.random.default_rng(0).integers(0, 256, (like.shape[0] // 8, like.shape[1] // 8, 3), np.uint8)
    cv2.imwrite(str(few / "another place.jpg"), cv2.resize(noise, like.shape[1::-1], interpolation=cv2.INTER_CUBIC))
    spaced = (few / NEAR[1]).rename(few / "ref 0101.jpg").name
    assert main(["map", str(few), "-o", str(tmp_path / "map"), *QUICK]) == 0
    said = capsys.readouterr().out
    assert "4 of 5 photographs registered" in said and "NOT registered: another place.jpg" in said
    assert sorted(ReferenceMap.load(tmp_path / "map").image_names) == sorted([NEAR[0], spaced, *NEAR[2:]])


def test_the_board_lies_where_the_map_begins(built, sample):
    """Tags measured in the map's own photographs: distances and upward direction are the board's."""
    reference_map = ReferenceMap.load(built[0])
    photographs = find_photographs(sample / "reference")
    # Only the photographs from one side of the board, against the map made from all of them.
    chosen = [row for row, name in enumerate(reference_map.image_names) if name in NEAR]
    views = [
        detect_tags(
            cv2.imread(str(sample / "reference" / reference_map.image_names[row]), cv2.IMREAD_GRAYSCALE),
            photographs.camera_of_name[reference_map.image_names[row]],
            FAMILIES["36h11"],
        )
        for row in chosen
    ]
    board = read_board(sample / "reference" / "board.yaml")
    taken_by = [photographs.camera_of_name[reference_map.image_names[row]] for row in chosen]
    again = align_to_board(reference_map.world_T_camera[chosen], views, taken_by, board)
    assert again.scale == pytest.approx(1.0, abs=1e-3)
    assert np.degrees(np.arccos(again.R[2, 2])) < 0.1
    assert np.linalg.norm(again.t) < 0.002
    summary = yaml.safe_load((built[0] / "map.yaml").read_text())
    residual = summary["board_residual"]
    assert residual["rms_px"] < 0.1 and residual["rms_mm"] < 0.3
    assert np.array_equal(summary["map_R_board"], np.eye(3))


def test_the_floor_around_the_board_is_flat_and_at_zero(built):
    points = ReferenceMap.load(built[0]).points_world
    near = points[np.linalg.norm(points[:, :2], axis=1) < 0.6]
    assert len(near) > 100
    assert abs(np.median(near[:, 2])) < 0.01


def test_the_colmap_model_shows_the_same_landmarks(built):
    reference_map = ReferenceMap.load(built[0])
    model = pycolmap.Reconstruction(built[0] / "sparse")
    assert sorted(model.points3D) == reference_map.landmark_ids.tolist()
    for landmark_id, point in zip(reference_map.landmark_ids, reference_map.points_world, strict=True):
        assert model.points3D[int(landmark_id)].xyz == pytest.approx(point)
    poses = dict(zip(reference_map.image_names, reference_map.world_T_camera, strict=True))
    for image in model.images.values():
        assert image.projection_center() == pytest.approx(poses[image.name][:3, 3])
        assert image.num_points3D == image.num_points2D() > 0
    model.update_point_3d_errors()
    assert model.compute_mean_reprojection_error() < 0.5


def test_descriptors_of_a_landmark_are_more_alike_than_of_two(built):
    m = ReferenceMap.load(built[0])
    same = np.flatnonzero(m.descriptor_landmark[1:] == m.descriptor_landmark[:-1])
    descriptors = m.descriptors.astype(float)
    own = np.linalg.norm(descriptors[same] - descriptors[same + 1], axis=1)
    other = np.linalg.norm(descriptors[same] - descriptors[np.roll(same, 500)], axis=1)
    assert np.median(own) < 0.6 * np.median(other)


def test_the_structure_can_be_looked_at(built):
    assert (built[0] / "structure.ply").read_bytes().startswith(b"ply\nformat binary_little_endian 1.0\n")


def test_a_map_is_not_replaced_by_accident(built, sample, capsys):
    assert main(["map", str(sample / "reference"), "-o", str(built[0])]) == 1
    assert "--force" in capsys.readouterr().err


def test_without_a_board_the_map_says_that_it_has_no_scale(few, tmp_path, capsys, caplog):
    (few / "board.yaml").unlink()
    assert main(["map", str(few), "-o", str(tmp_path / "map"), *QUICK]) == 0
    reference_map = ReferenceMap.load(tmp_path / "map")
    assert not reference_map.metric and not reference_map.gravity_aligned
    assert reference_map.summary["map_R_board"] is None
    assert yaml.safe_load((tmp_path / "map" / "map.yaml").read_text())["metric"] is False
    assert "NOT metric" in capsys.readouterr().out
    assert caplog.messages[0].startswith("the map will not be metric") and "--board" in caplog.messages[0]


def test_unusable_photographs_are_skipped_with_a_warning(few, tmp_path, caplog, capsys):
    (few / "broken.jpg").write_bytes(b"\xff\xd8\xff\xe0 torn")
    cv2.imwrite(str(few / "small.png"), np.zeros((100, 120), np.uint8))
    cv2.imwrite(str(few / "grey.png"), np.full((960, 1280), 90, np.uint8))
    assert main(["map", str(few), "--no-board", "-o", str(tmp_path / "map"), *QUICK]) == 0
    assert "broken.jpg" in caplog.text and "small.png" in caplog.text
    out = capsys.readouterr().out
    assert "4 of 5 photographs registered" in out and "NO" in out
    assert ReferenceMap.load(tmp_path / "map").image_names == tuple(NEAR)


def test_a_photograph_that_hardly_shows_the_place_is_named(few, sample, tmp_path, capsys):
    photograph = cv2.imread(str(sample / "reference" / "ref_0107.jpg"))
    shown = np.full_like(photograph, 90)
    shown[350:610, 510:770] = photograph[350:610, 510:770]
    cv2.imwrite(str(few / "hidden.png"), shown)
    assert main(["map", str(few), "-o", str(tmp_path / "map"), *QUICK]) == 0
    weak = [line for line in capsys.readouterr().out.splitlines() if "few landmarks" in line]
    assert len(weak) == 1 and "hidden.png" in weak[0] and "ref_" not in weak[0]


def expect_error(arguments, capsys, *words):
    assert main(["map", *map(str, arguments)]) == 1
    message = capsys.readouterr().err
    assert "Traceback" not in message
    for word in words:
        assert word in message.replace("\n", " "), message


def test_what_is_no_reference_folder_is_an_error(few, tmp_path, capsys):
    out = tmp_path / "map"
    expect_error([tmp_path / "nowhere", "-o", out], capsys, "nowhere", "no such folder")
    (tmp_path / "empty").mkdir()
    expect_error([tmp_path / "empty", "-o", out], capsys, "0 photographs")
    (few / "camera.yaml").unlink()
    expect_error([few, "-o", out], capsys, "camera.yaml")
    assert not out.exists()


def test_photographs_of_nothing_are_an_error(few, tmp_path, capsys):
    for path in few.glob("*.jpg"):
        path.write_bytes(b"torn")
    expect_error([few, "-o", tmp_path / "map"], capsys, "0 of 4 photographs", "ref_0099.jpg")


@pytest.mark.long
def test_photographs_of_different_places_are_an_error(few, tmp_path, capsys):
    rng = np.random.default_rng(0)
    for name in NEAR[2:]:
        (few / name).unlink()
    for path in few.glob("*.jpg"):
        cv2.imwrite(str(path), cv2.GaussianBlur(rng.integers(0, 256, (960, 1280), dtype=np.uint8), (0, 0), 3.0) * 2)
    expect_error([few, "--no-board", "-o", tmp_path / "map", *QUICK], capsys, "0 of 2 photographs register", "half")
    assert [p.name for p in tmp_path.iterdir()] == ["reference"]


def test_a_board_that_nobody_sees_is_an_error(few, tmp_path, capsys):
    board = yaml.safe_load((few / "board.yaml").read_text())
    board["corners_in_board"] = {tag + 100: corners for tag, corners in board["corners_in_board"].items()}
    (tmp_path / "other.yaml").write_text(yaml.safe_dump(board))
    arguments = [few, "--board", tmp_path / "other.yaml", "-o", tmp_path / "map", *QUICK]
    expect_error(arguments, capsys, "no photograph shows a tag", "--no-board")


def longer_lens(camera):
    camera["camera_matrix"]["data"][0] *= 2.0
    camera["camera_matrix"]["data"][4] *= 2.0


def other_lens(camera):
    camera["distortion_model"] = "equidistant"
    camera["distortion_coefficients"] = {"rows": 1, "cols": 4, "data": [0.0] * 4}


@pytest.mark.parametrize("another", [longer_lens, other_lens])
def test_the_intrinsics_of_another_camera_are_named(few, tmp_path, capsys, another):
    camera = yaml.safe_load((few / "camera.yaml").read_text())
    another(camera)
    (few / "camera.yaml").write_text(yaml.safe_dump(camera))
    expect_error([few, "-o", tmp_path / "map", *QUICK], capsys, "Check that camera.yaml belongs to the camera")
    assert not (tmp_path / "map").exists()


@pytest.mark.long
def test_interruption_amid_the_matching_leaves_nothing_behind(sample, tmp_path):
    command = [
        sys.executable,
        "-m",
        "bodycam_ros.cli.main",
        "map",
        str(sample / "reference"),
        "-o",
        str(tmp_path / "map"),
    ]
    (tmp_path / "scratch").mkdir()
    environment = {**os.environ, "TMPDIR": str(tmp_path / "scratch")}
    process = subprocess.Popen([*command, *QUICK], stderr=subprocess.PIPE, text=True, env=environment)
    while process.poll() is None and not any((tmp_path / "scratch").glob("*/*/pairs.txt")):
        time.sleep(0.05)
    process.send_signal(signal.SIGINT)
    _, message = process.communicate(timeout=120)
    assert process.returncode == 130 and "interrupted" in message
    assert "Traceback" not in message
    assert not (tmp_path / "map").exists()
    assert list((tmp_path / "scratch").iterdir()) == []
