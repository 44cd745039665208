"""bodycam lens on pictures of boards that were rendered through lenses that are known, and on real ones."""

import av
import cv2
import numpy as np
import pytest
from rendered_board import held_poses, rendered

from bodycam_ros.camera import camera_from_info, camera_from_yaml
from bodycam_ros.cli.main import main
from bodycam_ros.lens.board_design import board_yaml
from bodycam_ros.lens.board_layout import BoardLayout
from bodycam_ros.lens.lens_judgement import ray_grid
from bodycam_ros.lens.lens_validation import ray_difference_px

_TAGS = cv2.aruco.DICT_APRILTAG_36h11
_CLOSE_PX = 0.3


def _board_file(folder, layout):
    path = folder / "board.yaml"
    path.write_text(board_yaml(layout, "lying: board z is up"))
    return path


def _off_by_px(path, truth):
    camera = camera_from_yaml(path)
    return ray_difference_px(camera, truth, ray_grid(np.ones((truth.height, truth.width), dtype=bool))).max()


@pytest.mark.long
def test_a_fisheye_is_measured_from_images_of_a_charuco_board(tmp_path, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "120")  # narrower, the heads of the table are broken into lines
    truth = camera_from_info(
        "e", 480, 360, "equidistant", [0.02, -0.01, 0.003, -0.001], [190, 0, 241.5, 0, 190.6, 178.2, 0, 0, 1]
    )
    layout = BoardLayout("charuco", 6, 4, (0.04, 0.04), (0.03, 0.03), _TAGS)
    folder = tmp_path / "images"
    folder.mkdir()
    for number, image in enumerate(rendered(truth, layout, held_poses(truth, layout, 13, size=0.8))):
        cv2.imwrite(str(folder / f"{number:02}.png"), image)
    lens = tmp_path / "chest.yaml"
    words = ["lens", str(folder), "--board", str(_board_file(tmp_path, layout)), "-o", str(lens)]
    assert main([*words, "--model", "equidistant"]) == 0
    camera = camera_from_yaml(lens)
    assert (camera.name, camera.distortion_model, camera.width, camera.height) == ("chest", "equidistant", 480, 360)
    assert _off_by_px(lens, truth) < _CLOSE_PX
    picture = cv2.imread(str(lens.with_suffix(".png")))
    assert picture.shape[0] > 800
    assert picture.std() > 10.0
    assert "coverage and errors" in capsys.readouterr().out
    # What is there is replaced only when that is said.
    assert main(words) == 1
    assert "--force" in capsys.readouterr().err


@pytest.fixture(scope="module")
def filmed(tmp_path_factory):
    """A video of AprilTags, its board's file and its lens: held still for some frames, then moved on in a blur."""
    folder = tmp_path_factory.mktemp("filmed")
    truth = camera_from_info(
        "p", 480, 360, "plumb_bob", [-0.25, 0.08, 0.0008, -0.0006, 0.0], [320, 0, 238, 0, 321, 183, 0, 0, 1]
    )
    layout = BoardLayout("apriltag", 3, 2, (0.1, 0.1), (0.08, 0.08), _TAGS)
    stills = rendered(truth, layout, held_poses(truth, layout, 16, size=0.75))
    with av.open(str(folder / "clip.mp4"), "w") as container:
        stream = container.add_stream("libx264", rate=30)
        stream.width, stream.height, stream.pix_fmt = truth.width, truth.height, "yuv420p"
        stream.codec_context.options = {"crf": "14", "preset": "veryfast"}
        for still in stills:
            moving = cv2.blur(np.roll(still, 9, axis=1), (19, 1))
            for image in (still, still, moving):
                container.mux(stream.encode(av.VideoFrame.from_ndarray(image, format="gray")))
        container.mux(stream.encode(None))
    return folder / "clip.mp4", _board_file(folder, layout), truth


def test_a_video_makes_a_lens_and_the_model_is_found_out(filmed, tmp_path):
    video, board, truth = filmed
    lens = tmp_path / "lens.yaml"
    code = main(["lens", str(video), "--board", str(board), "-o", str(lens), "--lens.looked_at", "16"])
    assert code == 0
    assert camera_from_yaml(lens).distortion_model == "plumb_bob"
    assert _off_by_px(lens, truth) < _CLOSE_PX


def test_a_lens_that_would_hurt_is_not_written(filmed, tmp_path, capsys):
    video, board, _ = filmed
    lens = tmp_path / "lens.yaml"
    words = ["lens", str(video), "--board", str(board), "-o", str(lens), "--model", "plumb_bob"]
    assert main([*words, "--lens.looked_at", "16", "--lens.max_error", "0.05", "--lens.min_tilts", "20"]) == 3
    said = capsys.readouterr().out
    assert "tilt the board by 30 to 45 deg" in said
    assert "no lens was written" in said
    assert [path.name for path in tmp_path.iterdir()] == ["lens.png"]


def test_what_cannot_be_used_is_said(filmed, tmp_path, capsys):
    video, board, _ = filmed
    output = ["-o", str(tmp_path / "lens.yaml")]
    assert main(["lens", str(tmp_path / "gone.mp4"), "--board", str(board), *output]) == 1
    assert "no such file" in capsys.readouterr().err
    assert main(["lens", str(video), "--board", str(board), "-o", str(tmp_path / "lens.png")]) == 1
    assert "ends with .yaml" in capsys.readouterr().err
    plain = tmp_path / "plain"
    plain.mkdir()
    cv2.imwrite(str(plain / "a.png"), np.full((360, 480), 90, np.uint8))
    assert main(["lens", str(plain), "--board", str(board), *output]) == 1
    assert "0 of 1 pictures show this board" in capsys.readouterr().err
    cv2.imwrite(str(plain / "b.png"), np.full((300, 480), 90, np.uint8))
    capsys.readouterr()
    assert main(["lens", str(plain), "--board", str(board), *output]) == 1
    assert "480 x 300" in capsys.readouterr().err
    board = tmp_path / "board.yaml"
    board.write_text("{kind: charuco, family: 5X5_100, columns: 0, rows: 8}")
    assert main(["lens", str(plain), "--board", str(board), *output]) == 1
    assert "'columns' must be a whole number" in capsys.readouterr().err
    assert not (tmp_path / "lens.yaml").exists()


@pytest.mark.long
def test_the_hall_s_photographs_tell_the_lens_that_took_them(shared, tmp_path):
    hall = shared / "dev_hall" / "reference"
    lens = tmp_path / "lens.yaml"
    assert main(["lens", str(hall), "--board", str(hall / "board.yaml"), "-o", str(lens)]) == 0
    camera = camera_from_yaml(lens)
    assert camera.distortion_model == "plumb_bob"
    assert _off_by_px(lens, camera_from_yaml(hall / "camera.yaml")) < _CLOSE_PX
