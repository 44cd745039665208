"""Sizes of pictures by their headers alone, against OpenCV; what is absurdly large is not decoded."""

import struct
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.known_lenses import LENSES
from helpers.naming import naming
from helpers.tiny_bag import START_NS, write_jpeg, write_tiny_bag

from bodycam_ros.camera.camera_image import decode_grey, read_image_file
from bodycam_ros.camera.picture_size import picture_size
from bodycam_ros.errors import MapError, RecordingError
from bodycam_ros.messages.factory import header_message
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.bag_writer import RecordingWriter
from bodycam_ros.recording.typestore import recorded_messages

SIDE = 14_100


def huge_png() -> bytes:
    """A whole PNG of 200 million black pixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    squeezed = zlib.compress(bytes((SIDE + 1) * SIDE), 1)
    header = chunk(b"IHDR", struct.pack(">IIBBBBB", SIDE, SIDE, 8, 0, 0, 0, 0))
    return b"\x89PNG\r\n\x1a\n" + header + chunk(b"IDAT", squeezed) + chunk(b"IEND", b"")


@pytest.mark.parametrize("suffix", [".jpg", ".png"])
@pytest.mark.parametrize("size", [(1, 1), (640, 480), (3, 1000)])
@pytest.mark.parametrize("flags", [[], [cv2.IMWRITE_JPEG_PROGRESSIVE, 1, cv2.IMWRITE_JPEG_RST_INTERVAL, 2]])
def test_size_is_that_of_the_decoded_picture(suffix: str, size: tuple[int, int], flags: list[int]) -> None:
    pixels = np.random.default_rng(1).integers(0, 255, (size[1], size[0], 3), np.uint8)
    file = cv2.imencode(suffix, pixels, flags if suffix == ".jpg" else [])[1].tobytes()
    assert picture_size(file) == size


def test_damaged_headers_have_no_size_and_do_no_harm() -> None:
    whole = cv2.imencode(".jpg", np.zeros((48, 64, 3), np.uint8))[1].tobytes()
    random = np.random.default_rng(2)
    for file in (b"", b"\xff", b"\xff\xd8", b"\x89PNG\r\n\x1a\n", b"P5 3 4 255\n", whole[:30]):
        assert picture_size(file) is None
    for _ in range(300):
        damaged = bytearray(whole)
        damaged[int(random.integers(2, 200))] = int(random.integers(256))
        picture_size(bytes(damaged))


def test_an_absurdly_large_image_of_a_bag_is_refused_and_the_others_are_read(tmp_path: Path) -> None:
    def add_huge(writer: RecordingWriter) -> None:
        make, stamp_ns = recorded_messages(), START_NS + 10**9
        header, data = header_message(make, stamp_ns, "left"), np.frombuffer(huge_png(), np.uint8)
        image = make("sensor_msgs/msg/CompressedImage", header=header, format="png", data=data)
        writer.write("/left/image_raw/compressed", stamp_ns, image)
        write_jpeg(writer, "left", stamp_ns + 1, stamp_ns + 1, 50)

    with open_recording(write_tiny_bag(tmp_path / "huge", alter=add_huge)) as recording:
        *_, before, huge, after = recording.images(["left"])
    assert decode_grey(before).shape == decode_grey(after).shape
    with naming(RecordingError, "camera left", "14100x14100", "camera_info", "64x48"):
        decode_grey(huge)


def test_an_absurdly_large_photograph_is_refused_by_its_lens(tmp_path: Path) -> None:
    (path := tmp_path / "huge.png").write_bytes(huge_png())
    with naming(MapError, path, "14100x14100"):
        read_image_file(path, cv2.IMREAD_COLOR, MapError, next(iter(LENSES.values())))
