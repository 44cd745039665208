"""Pixels of decoded frames, in grey and in colours."""

from pathlib import Path

import av
import numpy as np
import pytest
from made_video import make_video
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import CameraImage, decode_colour, decode_grey
from bodycam_ros.video.video_decoder import VideoDecoder
from bodycam_ros.video.video_file import packets
from bodycam_ros.video.video_frame import DecodedFrame


def halves() -> NDArray[np.uint8]:
    """Pixels (32, 64, 3), blue, green, red: what is left is blue, what is right red."""
    pixels = np.full((32, 64, 3), 50, np.uint8)
    pixels[:, :32, 0] = 200
    pixels[:, 32:, 2] = 200
    return pixels


@pytest.mark.parametrize("full_range", [False, True])
@pytest.mark.parametrize("pixel_format", ["yuv420p", "yuv444p", "nv12", "rgb24"])
def test_a_frame_has_its_colours(pixel_format: str, full_range: bool) -> None:
    frame = av.VideoFrame.from_ndarray(halves(), format="bgr24")
    if pixel_format != "rgb24":
        frame = frame.reformat(format=pixel_format, dst_color_range=2 if full_range else 1)
    image = CameraImage("head", 5, DecodedFrame(frame))
    pixels = decode_colour(image)
    assert pixels.dtype == np.uint8 and pixels.flags.c_contiguous
    away_from_edge = np.delete(pixels.astype(int) - halves(), np.s_[28:36], axis=1)
    assert np.abs(away_from_edge).max() <= 4
    assert np.abs(pixels @ [0.114, 0.587, 0.299] - decode_grey(image))[:, :28].max() <= 3


@pytest.mark.parametrize("full_range", [False, True])
def test_a_video_is_as_bright_in_colours_as_in_grey(tmp_path: Path, full_range: bool) -> None:
    path = make_video(tmp_path / "head.mp4", frames=3, full_range=full_range)
    decoder = VideoDecoder()
    images = [CameraImage("head", number, timed.packet) for number, timed in enumerate(packets(path))]
    ready = [decoded for image in images for decoded in decoder.feed(image)] + decoder.flush()
    assert len(ready) == 3
    for image in ready:
        assert np.abs(decode_colour(image).astype(int) - decode_grey(image)[..., None]).max() <= 3
