"""Images in grey and in colours, and those that cannot be decoded, or must not be."""

import subprocess
import sys
from collections.abc import Callable

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import CameraImage, decode_colour, decode_grey
from bodycam_ros.camera.raw_picture import RawPicture
from bodycam_ros.errors import RecordingError

BLUE, GREEN, RED = 0, 1, 2


def coloured() -> NDArray[np.uint8]:
    """Pixels (24, 40, 3), blue, green, red: what is left is blue, what is right red."""
    pixels = np.full((24, 40, 3), 40, np.uint8)
    pixels[:, :20, BLUE] = 200
    pixels[:, 20:, RED] = 200
    return pixels


def padded(pixels: NDArray[np.uint8]) -> NDArray[np.uint8]:
    """The same pixels in rows with a gap between them, and read only, as they lie in a message."""
    height, width = pixels.shape[:2]
    rows = np.zeros((height, width * 3 + 5), np.uint8)
    rows[:, :-5] = pixels.reshape(height, -1)
    rows.flags.writeable = False
    return rows[:, :-5].reshape(pixels.shape)


def encoded(suffix: str, pixels: NDArray[np.uint8]) -> bytes:
    return cv2.imencode(suffix, pixels)[1].tobytes()


@pytest.mark.parametrize(
    ("content", "off"),
    [
        (encoded(".png", coloured()), 0),
        (encoded(".jpg", coloured()), 12),
        (RawPicture("bgr8", coloured()), 0),
        (RawPicture("bgr8", padded(coloured())), 0),
        (RawPicture("rgb8", padded(coloured()[..., ::-1])), 0),
    ],
    ids=["png", "jpg", "bgr", "bgr with gaps", "rgb with gaps"],
)
def test_colours_are_blue_green_red_and_grey_is_of_them(content: bytes | RawPicture, off: int) -> None:
    image = CameraImage("head", 5, content)
    pixels = decode_colour(image)
    assert pixels.dtype == np.uint8 and pixels.flags.c_contiguous and pixels.flags.writeable
    away_from_edge = np.delete(pixels.astype(int) - coloured(), np.s_[12:28], axis=1)
    assert np.abs(away_from_edge).max() <= off
    grey = decode_grey(image)
    assert grey.flags.c_contiguous
    # As the standard weighs them (BT.601).
    np.testing.assert_allclose(grey, pixels @ [0.114, 0.587, 0.299], atol=1.0 if off == 0 else 8.0)


@pytest.mark.parametrize("decode", [decode_grey, decode_colour])
@pytest.mark.parametrize(
    "content", [b"", b"no picture", b"\xff\xd8\xff\xe0 a JPEG that ends early", b"P5 1000000 1000000 255\n"]
)
def test_undecodable_image_is_an_error_that_names_it(
    content: bytes, decode: Callable[[CameraImage], NDArray[np.uint8]]
) -> None:
    with pytest.raises(RecordingError, match="camera head: the image of stamp 5 ns"):
        decode(CameraImage("head", 5, content))


def test_a_small_file_of_a_huge_image_takes_no_memory() -> None:
    """Nine hundred megabytes of grey in one of PNG; in a process of its own, as OpenCV reads its limit once."""
    code = """
import sys, zlib
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.errors import RecordingError
def chunk(kind, data):
    return len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big")
side = 30_000
header = chunk(b"IHDR", side.to_bytes(4, "big") * 2 + bytes([8, 0, 0, 0, 0]))
squeezer = zlib.compressobj(1)
data = b"".join(squeezer.compress(bytes(side + 1)) for _ in range(side)) + squeezer.flush()
png = b"\\x89PNG\\r\\n\\x1a\\n" + header + chunk(b"IDAT", data) + chunk(b"IEND", b"")
try:
    decode_grey(CameraImage("head", 5, png))
except RecordingError as error:
    peak = next(line for line in open("/proc/self/status") if line.startswith("VmHWM"))
    print(peak.split()[1], error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    kilobytes, message = done.stdout.split(" ", 1)
    assert int(kilobytes) < 400_000
    assert "camera head: the image of stamp 5 ns" in message
