"""Frames of a video and of a bag, as photographs are taken of them."""

from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.made_video import HEIGHT, WIDTH, make_video, picture, turn, write_lens
from helpers.naming import naming
from helpers.tiny_bag import HEIGHT as BAG_HEIGHT
from helpers.tiny_bag import WIDTH as BAG_WIDTH

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.errors import LensError
from bodycam_ros.mapping.moving_camera import open_body_cameras, picture_file, video_camera


def test_a_video_on_its_side_is_turned_as_its_lens_is_for(tmp_path: Path) -> None:
    path = turn(make_video(tmp_path / "walk.mp4", frames=3), 90)
    lying, upright = write_lens(tmp_path / "lying.yaml"), write_lens(tmp_path / "upright.yaml", (HEIGHT, WIDTH))
    with naming(LensError, lying, "96 x 64", "64 x 96"):
        video_camera(path, lying)
    with video_camera(path, upright).frames() as frames:
        first = next(frames)
    suffix, content = picture_file(first)
    written = cv2.imdecode(np.frombuffer(content, np.uint8), cv2.IMREAD_GRAYSCALE)
    for upright_pixels in (decode_grey(first), written):
        assert upright_pixels is not None and suffix == ".jpg"
        assert np.abs(np.rot90(upright_pixels).astype(int) - picture(0)).mean() < 6.0


@pytest.mark.parametrize("clockwise", [0, 90, 180, 270])
def test_rows_are_read_out_as_the_camera_was_held(tmp_path: Path, clockwise: int) -> None:
    """When each pixel was exposed is turned like the picture."""
    path = turn(make_video(tmp_path / "walk.mp4", frames=3), clockwise)
    exposed_s = 0.012 * np.rot90(np.tile(np.linspace(0.0, 1.0, HEIGHT)[:, None], WIDTH), -clockwise // 90)
    lens = write_lens(tmp_path / "lens.yaml", exposed_s.shape[::-1], "readout_time: 0.012\n")
    across, down = video_camera(path, lens).readout_s
    assert across == pytest.approx(exposed_s[0, -1] - exposed_s[0, 0])
    assert down == pytest.approx(exposed_s[-1, 0] - exposed_s[0, 0])


def test_frames_of_a_bag_can_be_read_again(tiny_bag: Path) -> None:
    camera = open_body_cameras(tiny_bag, ["right"])["right"]
    assert (camera.camera.width, camera.camera.height, camera.count) == (BAG_WIDTH, BAG_HEIGHT, 4)
    for _ in range(2):
        with camera.frames() as frames:
            found = list(frames)
        assert [round(float(decode_grey(frame).mean())) for frame in found] == [10, 20, 30, 40]
        assert np.diff([1e-9 * frame.stamp_ns for frame in found]) == pytest.approx([1 / 30] * 3, abs=1e-6)
