"""Compressed parts of bags, unpacked up to what a recorder would have packed: a megabyte can unpack to gigabytes.

rosbags compares a part's size with the one that is stated only once all of it is unpacked.
"""

from collections.abc import Iterable
from functools import partial
from pathlib import Path
from typing import Any

from backports import zstd
from lz4.frame import LZ4FrameDecompressor
from rosbags.rosbag2 import storage_mcap

from bodycam_ros.errors import RecordingError

_MOST_RATIO = 100
"""Ratio of sizes after and before; raw images of a covered lens have more, which the next allows for."""

_ALWAYS_BYTES = 100_000_000
_MOST_AT_ONCE_BYTES = 300_000_000
"""Bytes of parts of a file that overlap in time, which rosbags holds at the same time."""

_PIECE = 1 << 20


class UnpackingError(Exception):
    """A part of a bag unpacks to too much."""


def unpack(content: bytes, stated: int | None = None, compression: str = "zstd") -> bytes:
    """Unpack a part.

    Args:
        content: of one frame.
        stated: size that it unpacks to [bytes]; None if the bag does not say.
        compression: zstd or lz4.

    Raises:
        UnpackingError: it unpacks to more than is stated, or than a recorder would have packed into so little.
    """
    expected = _bound(len(content)) if stated is None else stated
    check_stated(len(content), expected)
    unpacker: Any = zstd.ZstdDecompressor() if compression == "zstd" else LZ4FrameDecompressor()
    unpacked: bytes = unpacker.decompress(content, max_length=expected + 1)
    if len(unpacked) > expected:
        raise UnpackingError(_too_much(len(content), f"more than {expected} bytes"))
    return unpacked


def check_stated(packed: int, stated: int) -> None:
    """Refuse a part of so many bytes by the size that it states.

    Raises:
        UnpackingError: no recorder would have packed as much into so little.
    """
    if stated > _bound(packed):
        raise UnpackingError(_too_much(packed, f"{stated} bytes"))


def bound_rosbags() -> None:
    """Make rosbags unpack the parts of MCAP files by ``unpack``: its table of decompressors is the place for others."""
    storage_mcap.DECOMPRESSORS.update({name: partial(unpack, compression=name) for name in ("zstd", "lz4")})


def check_packed_file(path: Path) -> None:
    """Unpack a file that is compressed as a whole, to nowhere, up to what is too much; rosbags unpacks it to the disk.

    Raises:
        RecordingError: it unpacks to too much.
        OSError: it cannot be read.
    """
    size = path.stat().st_size
    most, unpacked = _bound(size), 0
    with zstd.open(path, "rb") as file:
        while piece := file.read(_PIECE):
            unpacked += len(piece)
            if unpacked > most:
                raise RecordingError(f"{path}: {_too_much(size, f'more than {most} bytes')}; 'zstd -d' unpacks it")


def check_overlap(storages: Iterable[Any]) -> None:
    """Refuse files whose compressed parts would be held at once, and are too much together.

    Raises:
        RecordingError: so it is.
    """
    for storage in storages:
        ends: list[tuple[int, int]] = []
        for chunk in getattr(storage, "chunks", ()):
            if chunk.compression:
                ends += [
                    (chunk.message_start_time, chunk.uncompressed_size),
                    (chunk.message_end_time + 1, -chunk.uncompressed_size),
                ]
        at_once = 0
        for _, change in sorted(ends):
            at_once += change
            if at_once > _MOST_AT_ONCE_BYTES:
                raise RecordingError(
                    f"{storage.path}: its parts at one time unpack to more than {_MOST_AT_ONCE_BYTES >> 20} MB, as no "
                    "recorder writes them; write it anew with 'mcap sort' if it is yours"
                )


def _bound(packed: int) -> int:
    return max(_ALWAYS_BYTES, _MOST_RATIO * packed)


def _too_much(packed: int, unpacked: str) -> str:
    return f"a part of {packed} bytes unpacks to {unpacked}, as no recorder packs them"
