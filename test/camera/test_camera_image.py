"""Images in grey and in colours, and those that cannot be decoded, or must not be."""

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.naming import naming
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import CameraImage, decode_colour, decode_grey, read_image_file
from bodycam_ros.errors import RecordingError


@pytest.mark.parametrize("decode", [decode_grey, decode_colour])
@pytest.mark.parametrize(
    "content", [b"", b"no picture", b"\xff\xd8\xff\xe0 a JPEG that ends early", b"P5 1000000 1000000 255\n"]
)
def test_undecodable_image_is_an_error_that_names_it(
    content: bytes, decode: Callable[[CameraImage], NDArray[np.uint8]]
) -> None:
    with naming(RecordingError, "camera head", "5 ns"):
        decode(CameraImage("head", 5, content))


def test_pixels_are_grey_or_blue_green_red() -> None:
    colours = np.random.default_rng(0).integers(0, 255, (6, 8, 3), np.uint8)
    image = CameraImage("head", 5, colours)
    np.testing.assert_array_equal(decode_grey(image), cv2.cvtColor(colours, cv2.COLOR_BGR2GRAY))
    np.testing.assert_array_equal(decode_colour(image), colours)
    for wrong in (colours.astype(float), colours[..., :2], colours[0, 0], colours[:0]):
        with naming(RecordingError, "camera head", str(wrong.shape), str(wrong.dtype)):
            decode_grey(CameraImage("head", 5, wrong))  # type: ignore[arg-type]


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
    assert "camera head" in message


def test_a_file_is_read_whatever_its_name_is(tmp_path: Path) -> None:
    pixels = np.random.default_rng(0).integers(0, 255, (8, 12, 3), np.uint8)
    plain = tmp_path / "a.png"
    cv2.imwrite(str(plain), pixels)
    other = tmp_path / os.fsdecode(b"\xff\xfe.png")
    other.write_bytes(plain.read_bytes())
    assert np.array_equal(read_image_file(other, cv2.IMREAD_COLOR), pixels)
    broken = tmp_path / "b.png"
    broken.write_bytes(plain.read_bytes()[:20])
    empty = tmp_path / "c.png"
    empty.touch()
    for path in (broken, empty, tmp_path / "missing.png", tmp_path):
        with naming(RecordingError, path):
            read_image_file(path, cv2.IMREAD_GRAYSCALE)
