"""Pixels of decoded frames, in grey and in colours."""

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import CameraImage, decode_colour, decode_grey
from bodycam_ros.recording.video_file import DecodedFrame


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
