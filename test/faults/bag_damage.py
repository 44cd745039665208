"""Damage to the records of an MCAP file, which its bytes alone would hardly hit."""

import struct
from collections.abc import Callable, Iterator, Mapping

import numpy as np
from faults.byte_damage import Damage

_MAGIC = b"\x89MCAP0\r\n"
_SCHEMA = 3
_CHANNEL = 4
_MESSAGE = 5
_CHUNK = 6
_FOOTER = 2


def _records(content: bytes) -> Iterator[tuple[int, int, int]]:
    """Kind, start of the length field and end of each record of the file."""
    at = len(_MAGIC)
    while at + 9 <= len(content) - len(_MAGIC):
        length = struct.unpack_from("<Q", content, at + 1)[0]
        yield content[at], at + 1, at + 9 + length
        at += 9 + length


def _one(content: bytes, random: np.random.Generator, kinds: tuple[int, ...]) -> tuple[int, int]:
    """Start of the length field and end of a record of one of some kinds."""
    found = [(start, end) for kind, start, end in _records(content) if kind in kinds]
    return found[int(random.integers(len(found)))]


def _patched(kinds: tuple[int, ...], offset: int, patch: bytes) -> Damage:
    """Overwrite bytes of a record, at an offset from its content, negative for its length."""

    def damage(content: bytes, random: np.random.Generator) -> bytes:
        at = _one(content, random, kinds)[0] + 8 + offset
        return content[:at] + patch + content[at + len(patch) :]

    return damage


def _without(kinds: tuple[int, ...]) -> Damage:
    """Leave a record out; what says where the others are is wrong from there on."""

    def damage(content: bytes, random: np.random.Generator) -> bytes:
        start, end = _one(content, random, kinds)
        return content[: start - 1] + content[end:]

    return damage


def _renamed(old: bytes, new: bytes) -> Callable[[bytes, np.random.Generator], bytes]:
    """Give every topic or type another name of the same length."""
    return lambda content, random: content.replace(old, new.ljust(len(old), b"x")[: len(old)])


_ANY = (_SCHEMA, _CHANNEL, _CHUNK, _FOOTER)

DAMAGES: Mapping[str, Damage] = {
    "a record of 9 exabytes": _patched(_ANY, -8, b"\xff" * 7 + b"\x7f"),
    "a record of 16 gigabytes": _patched(_ANY, -8, struct.pack("<Q", 1 << 34)),
    "a chunk that unpacks to a terabyte": _patched((_CHUNK,), 16, struct.pack("<Q", 1 << 40)),
    "a chunk of another checksum": _patched((_CHUNK,), 24, b"\x01\x02\x03\x04"),
    "a chunk of unknown compression": _patched((_CHUNK,), 28, struct.pack("<I", 4) + b"rar5"),
    "a chunk before the epoch": _patched((_CHUNK,), 0, struct.pack("<q", -5)),
    "a chunk of the far future": _patched((_CHUNK,), 0, b"\xff" * 16),
    "no chunk": _without((_CHUNK,)),
    "no schema": _without((_SCHEMA,)),
    "no channel": _without((_CHANNEL,)),
    "an index that points nowhere": _patched((_FOOTER,), 0, struct.pack("<QQ", 1 << 50, 1 << 51)),
    "no index": _patched((_FOOTER,), 0, bytes(20)),
    "escapes in topics": _renamed(b"/waist_front/", b"/\x1b[31mwaist\x07/"),
    "topics that are not UTF-8": _renamed(b"/waist_front/", b"/\xff\xfe\xfd_front_/"),
    "topics without a name": _renamed(b"/waist_front/", b"/////////////"),
    "another type": _renamed(b"sensor_msgs/msg/CompressedImage", b"sensor_msgs/msg/PointCloud2"),
    "an unknown type": _renamed(b"sensor_msgs/msg/CameraInfo", b"sensor_msgs/msg/CameraOdd"),
    "another encoding": _renamed(b"cdr", b"xml"),
}
