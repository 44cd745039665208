"""The size that a picture's file claims, before its pixels are made: some kilobytes can claim gigabytes of them."""

import struct

from bodycam_ros.camera.model import CameraModel
from bodycam_ros.errors import RecordingError

_LARGER = 4
"""Times as many pixels as a lens is calibrated for: a picture that is somewhat too large is refused where it is used,
by its size; one that is absurdly large is not decoded."""

_PNG, _JPEG = b"\x89PNG\r\n\x1a\n", b"\xff\xd8"
_FRAMES = {*range(0xC0, 0xD0)} - {0xC4, 0xC8, 0xCC}  # JPEG's markers of a frame's header; the others are tables
_WITHOUT_LENGTH = {0x01, *range(0xD0, 0xD9)}


def picture_size(file: bytes) -> tuple[int, int] | None:
    """Width and height [px] in the header of a PNG or JPEG; None of any other file."""
    if file.startswith(_PNG):
        return struct.unpack_from(">II", file, 16) if len(file) >= 24 else None
    at = 2 if file.startswith(_JPEG) else len(file)
    while at + 9 <= len(file):
        if file[at] != 0xFF:
            at += 1
            continue
        marker = file[at + 1]
        if marker in _FRAMES:
            height, width = struct.unpack_from(">HH", file, at + 5)
            return width, height
        # A byte may be repeated before a marker.
        at += 1 if marker == 0xFF else 2
        if marker != 0xFF and marker not in _WITHOUT_LENGTH:
            at += int.from_bytes(file[at : at + 2], "big")
    return None


def check_picture_size(file: bytes, lens: CameraModel) -> None:
    """Refuse a picture that is absurdly large for its camera's lens.

    Raises:
        RecordingError: so it is; names the camera.
    """
    size = picture_size(file)
    if size is not None and size[0] * size[1] > _LARGER * lens.width * lens.height:
        raise RecordingError(
            f"image of {size[0]}x{size[1]} pixels, but its camera_info says {lens.width}x{lens.height}; "
            "it is not decoded",
            lens.name,
        )
