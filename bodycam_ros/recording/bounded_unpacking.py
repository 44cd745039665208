"""Lets rosbags unpack what is compressed in a bag as far as the bag says that it goes, and no farther than bags go.

A megabyte can unpack to gigabytes, and rosbags compares its size with the promised one when it has all of it. There are
three places: chunks of MCAP, single messages, whole files. What unpacks (lz4, zstd) comes with rosbags. Programs of
ours do so; a program that imports the package keeps rosbags as it is.
"""

from collections.abc import Callable
from functools import cache
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO, Protocol, cast

from lz4.frame import LZ4FrameDecompressor
from rosbags.rosbag2 import ReaderError, reader, storage_mcap

MOST_CHUNK = 1 << 30
"""[bytes] of a chunk or message; recorders make chunks of some megabytes, larger ones of large messages alone."""

_MOST_TIMES, _SMALL = 200, 1 << 30
"""A file may unpack to so many times its size, and to so many bytes in any case; it goes to the disk."""

_MOST_FRAMES = 1000
"""Of a chunk or message, where recorders make one: each that is begun copies what is left."""

_SLICE = 1 << 20

_zstd: ModuleType = vars(reader)["zstd"]  # Python's own from 3.14 on, else its backport: rosbags chooses


class _Decompressor(Protocol):
    eof: bool
    unused_data: bytes | None

    def decompress(self, data: bytes, max_length: int) -> bytes:
        """Unpack to at most so many bytes."""


def _bounded(new: Callable[[], _Decompressor], data: bytes, size: int) -> bytes:
    """Unpack frame after frame; more than ``size`` bytes are an error."""
    if size > MOST_CHUNK:
        raise ReaderError(f"{size} bytes in one piece; bags have at most {MOST_CHUNK}")
    parts, left = [], size
    while data:
        frame = new()
        parts.append(frame.decompress(data, left + 1))
        if len(parts) > _MOST_FRAMES:
            raise ReaderError(f"more than {_MOST_FRAMES} compressed frames in one piece")
        left -= len(parts[-1])
        if left < 0:
            raise ReaderError(f"more than the {size} bytes that it should unpack to")
        if not frame.eof:
            raise ReaderError("what is compressed ends too early")
        data = frame.unused_data or b""
    return parts[0] if len(parts) == 1 else b"".join(parts)


class _BoundedZstd:
    """What rosbags' reader of bag folders uses of the module ``zstd``: of a message, and of a whole file."""

    @staticmethod
    def decompress(data: bytes) -> bytes:
        """Unpack a message."""
        return _bounded(_zstd.ZstdDecompressor, data, MOST_CHUNK)

    @staticmethod
    def open(file: BinaryIO, mode: str) -> "_BoundedFile":
        """Unpack a file that is open."""
        return _BoundedFile(_zstd.open(file, mode), Path(file.name).stat().st_size * _MOST_TIMES + _SMALL)


class _BoundedFile:
    """An open file of which no more than so many bytes are read."""

    def __init__(self, file: Any, most: int) -> None:
        self._file, self._left = file, most

    def __enter__(self) -> "_BoundedFile":
        return self

    def __exit__(self, *_: object) -> None:
        self._file.close()

    def read(self, size: int = -1) -> bytes:
        """At most so many bytes, or the whole slice that is next."""
        content = cast(bytes, self._file.read(_SLICE if size < 0 else min(size, _SLICE)))
        self._left -= len(content)
        if self._left < 0:
            raise ReaderError(f"it unpacks to more than {_MOST_TIMES} times its size")
        return content


@cache
def bound_unpacking() -> None:
    """Have rosbags unpack so in this process, for all who use it there."""
    storage_mcap.DECOMPRESSORS.update(
        lz4=lambda data, size: _bounded(LZ4FrameDecompressor, data, size),
        zstd=lambda data, size: _bounded(_zstd.ZstdDecompressor, data, size),
    )
    vars(reader)["zstd"] = _BoundedZstd
