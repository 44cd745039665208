"""bodycam lens on pictures of boards that were rendered through lenses that are known, and on real ones."""

from dataclasses import replace

import av
import cv2
import numpy as np
import pytest
import yaml
from helpers.rendered_board import board_size, held_poses, rendered

from bodycam_ros.boards.board_design import board_yaml
from bodycam_ros.boards.board_layout import BoardLayout
from bodycam_ros.camera import camera_from_info, camera_from_yaml
from bodycam_ros.cli.main import main
from bodycam_ros.lens.lens_quality import ray_difference_px, ray_grid

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
    assert picture.shape[0] > 500
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
        stream.width = truth.width
        stream.height = truth.height
        stream.pix_fmt = "yuv420p"
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
    code = main(["lens", str(video), "--board", str(board), "-o", str(lens)])
    assert code == 0
    assert camera_from_yaml(lens).distortion_model == "plumb_bob"
    assert _off_by_px(lens, truth) < _CLOSE_PX


def test_a_lens_that_explains_no_picture_is_not_written(filmed, tmp_path, capsys):
    video, board, _ = filmed
    odd = tmp_path / "odd"
    odd.mkdir()
    longer = yaml.safe_load(board.read_text())
    longer["corners_in_board"] = {
        tag: [[x + 0.04 * (tag % 2), y, z] for x, y, z in corners]
        for tag, corners in longer["corners_in_board"].items()
    }
    (odd / "board.yaml").write_text(yaml.safe_dump(longer))
    lens = tmp_path / "lens.yaml"
    words = ["lens", str(video), "--board", str(odd / "board.yaml"), "-o", str(lens), "--model", "plumb_bob"]
    assert main(words) == 3
    said = capsys.readouterr().out
    assert "its file right" in " ".join(said.split())
    assert "no lens was written" in said
    assert not lens.exists() and lens.with_suffix(".png").exists()


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


_PINHOLE = [536, 0, 330, 0, 536, 236, 0, 0, 1]
_CHECKERBOARD = BoardLayout("checkerboard", 10, 7, (0.025, 0.025))


def _whole(truth, layout, count, seed=3):
    """Pictures that show all of a board, and their sizes differ little."""
    half = 0.5 * np.array(board_size(layout))
    rim = np.column_stack([np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half, np.zeros(4)])
    poses = []
    for pose in held_poses(truth, layout, 30 * count, seed=seed, size=0.72):
        pixels, valid = truth.project(rim @ pose[:3, :3].T + pose[:3, 3])
        if valid.all() and (pixels > 8).all() and (pixels < [truth.width - 9, truth.height - 9]).all():
            poses.append(pose)
    return rendered(truth, layout, poses[:count], blur_px=0.9)


@pytest.fixture(scope="module")
def checkerboards():
    """A lens, and thirteen pictures of a checkerboard that has to be whole in each, as OpenCV's examples have it."""
    truth = camera_from_info("c", 640, 480, "plumb_bob", [-0.265, -0.047, 0.0018, -0.0003, 0.25], _PINHOLE)
    return truth, _whole(truth, _CHECKERBOARD, 13)


def _opencv(images):
    """cv2.calibrateCamera on the same pictures."""
    size = (_CHECKERBOARD.columns - 1, _CHECKERBOARD.rows - 1)
    end = (cv2.TERM_CRITERIA_EPS | cv2.TERM_CRITERIA_MAX_ITER, 30, 1e-3)
    found = [corners for image in images for ok, corners in [cv2.findChessboardCorners(image, size)] if ok]
    pixels = [cv2.cornerSubPix(i, c, (7, 7), (-1, -1), end) for i, c in zip(images, found, strict=True)]
    points = [_CHECKERBOARD.inner_corners.astype(np.float32)] * len(pixels)
    _, K, d, *_ = cv2.calibrateCamera(points, pixels, images[0].shape[::-1], None, None)
    return camera_from_info("cv", *images[0].shape[::-1], "plumb_bob", d.ravel().tolist(), K.ravel().tolist())


@pytest.mark.parametrize("change", ["as it is", "inverted", "mirrored", "inner corners counted"])
def test_a_checkerboard_that_is_whole_in_each_picture_makes_a_lens_as_good_as_opencv_s(
    checkerboards, tmp_path, capsys, change
):
    truth, images = checkerboards
    layout = _CHECKERBOARD
    if change == "inverted":
        images = [255 - image for image in images]
    elif change == "mirrored":
        images = [np.ascontiguousarray(image[:, ::-1]) for image in images]
    elif change == "inner corners counted":
        layout = BoardLayout("checkerboard", 9, 6, (0.025, 0.025))
    folder = tmp_path / "pictures"
    folder.mkdir()
    for number, image in enumerate(images):
        cv2.imwrite(str(folder / f"left{number:02}.png"), image)
    lens = tmp_path / "lens.yaml"
    assert main(["lens", str(folder), "--board", str(_board_file(tmp_path, layout)), "-o", str(lens)]) == 0
    said = " ".join(capsys.readouterr().out.split())
    assert "13 show the board" in said
    text = lens.read_text()
    assert "# standard deviations [px]: fx" in text and "# warning:" in text
    assert ("inner corners" in said) == ("inner" in change)
    if change == "mirrored":
        return
    near = ray_grid(np.ones((480, 640), dtype=bool), 0.55)
    ours = ray_difference_px(camera_from_yaml(lens), truth, near).max()
    assert ours < max(0.15, 1.5 * ray_difference_px(_opencv(checkerboards[1]), truth, near).max())


@pytest.mark.parametrize(
    ("count", "k", "d", "noise"),
    [
        (6, [480, 0, 300, 0, 480, 250, 0, 0, 1], [0.0] * 5, 0.0),
        (13, [540, 0, 324, 0, 540, 251, 0, 0, 1], [-0.278, -0.047, 0.0018, -0.0003, 0.25], 10.0),
    ],
    ids=["unlike", "stereo pair"],
)
def test_pictures_of_two_cameras_are_noticed(checkerboards, tmp_path, capsys, count, k, d, noise):
    _, images = checkerboards
    other = _whole(camera_from_info("c", 640, 480, "plumb_bob", d, k), _CHECKERBOARD, count - 1, seed=7)
    board, both = _in_one_folder(tmp_path, images[:count], other, noise)
    assert main(["lens", str(both), "--board", str(board), "-o", str(tmp_path / "lens.yaml")]) == 1
    assert "pictures left*.png and right*.png were taken by different cameras" in " ".join(
        capsys.readouterr().err.split()
    )


def test_pictures_of_one_camera_may_have_two_names(checkerboards, tmp_path):
    truth, images = checkerboards
    board, both = _in_one_folder(tmp_path, images[:7], images[7:])
    words = ["lens", str(both), "--board", str(board), "-o", str(tmp_path / "lens.yaml"), "--model", "plumb_bob"]
    assert main(words) == 0
    assert camera_from_yaml(tmp_path / "lens.yaml").fx == pytest.approx(truth.fx, abs=1.0)


def _in_one_folder(folder, left, right, noise=0.0):
    random = np.random.default_rng(5)
    both = folder / "both"
    both.mkdir()
    for name, group in (("left", left), ("right", right)):
        for number, image in enumerate(group):
            noisy = np.clip(image + random.normal(0.0, noise, image.shape), 0, 255)
            cv2.imwrite(str(both / f"{name}{number:02}.png"), noisy.astype(np.uint8))
    return _board_file(folder, _CHECKERBOARD), both


@pytest.mark.parametrize("change", ["inverted", "mirrored", "upper left square"])
def test_a_charuco_board_that_is_not_as_its_file_has_it_is_found(tmp_path, capsys, change):
    truth = camera_from_info("f", 480, 360, "fov", [0.9], [225, 0, 243, 0, 225, 177, 0, 0, 1])
    layout = BoardLayout("charuco", 6, 4, (0.04, 0.04), (0.03, 0.03), _TAGS)
    for number, image in enumerate(rendered(truth, layout, held_poses(truth, layout, 12, size=0.9))):
        changed = {"inverted": 255 - image, "mirrored": image[:, ::-1]}.get(change, image)
        cv2.imwrite(str(tmp_path / f"{number:02}.png"), changed)
    layout = replace(layout, upper_left_is_black=change != "upper left square")
    words = ["--board", str(_board_file(tmp_path, layout)), "-o", str(tmp_path / "lens.yaml"), "--model", "fov"]
    assert main(["lens", *map(str, sorted(tmp_path.glob("*.png"))), *words]) == 0
    assert change in " ".join(capsys.readouterr().out.split())
    camera = camera_from_yaml(tmp_path / "lens.yaml")
    assert camera.fx == pytest.approx(225, abs=1.0)
    assert camera.cx == pytest.approx(479 - 243 if change == "mirrored" else 243, abs=1.0)


@pytest.mark.long
def test_the_hall_s_photographs_tell_the_lens_that_took_them(shared, tmp_path):
    hall = shared / "dev_hall" / "reference"
    lens = tmp_path / "lens.yaml"
    assert main(["lens", str(hall), "--board", str(hall / "board.yaml"), "-o", str(lens)]) == 0
    camera = camera_from_yaml(lens)
    assert camera.distortion_model == "plumb_bob"
    assert _off_by_px(lens, camera_from_yaml(hall / "camera.yaml")) < _CLOSE_PX
