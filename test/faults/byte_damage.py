"""Damage to the bytes of any file: what bad disks, broken copies and wrong names make of it."""

from collections.abc import Callable, Mapping

import numpy as np

Damage = Callable[[bytes, np.random.Generator], bytes]
"""(content, random) -> damaged content."""

_BLOCK = 20_000
_HUGE = (b"\xff" * 8, b"\x00" * 7 + b"\x7f", b"\x00\x00\x00\x00\x00\x01\x00\x00")


def _flipped(content: bytes, random: np.random.Generator, places: np.ndarray) -> bytes:
    damaged = bytearray(content)
    for place in places:
        damaged[place] ^= 1 << int(random.integers(8))
    return bytes(damaged)


def _flip_one(content: bytes, random: np.random.Generator) -> bytes:
    return _flipped(content, random, random.integers(len(content), size=1))


def _flip_in_the_head(content: bytes, random: np.random.Generator) -> bytes:
    return _flipped(content, random, random.integers(min(64, len(content)), size=3))


def _flip_in_the_tail(content: bytes, random: np.random.Generator) -> bytes:
    return _flipped(content, random, len(content) - 1 - random.integers(min(600, len(content)), size=3))


def _flip_many(content: bytes, random: np.random.Generator) -> bytes:
    return _flipped(content, random, random.integers(len(content), size=max(4, len(content) // 1000)))


def _cut(content: bytes, random: np.random.Generator) -> bytes:
    return content[: int(random.integers(1, len(content)))]


def _cut_a_little(content: bytes, random: np.random.Generator) -> bytes:
    return content[: -int(random.integers(1, 40))]


def _zeroed_block(content: bytes, random: np.random.Generator) -> bytes:
    length = min(_BLOCK, max(1, len(content) // 3))
    start = int(random.integers(len(content) - length + 1))
    return content[:start] + bytes(length) + content[start + length :]


def _zeroed_head(content: bytes, random: np.random.Generator) -> bytes:
    return bytes(min(16, len(content))) + content[16:]


def _random_bytes(content: bytes, random: np.random.Generator) -> bytes:
    return random.bytes(min(len(content), 4096))


def _head_of_random_bytes(content: bytes, random: np.random.Generator) -> bytes:
    return content[:8] + random.bytes(min(len(content), 4096))


def _huge_number(content: bytes, random: np.random.Generator) -> bytes:
    start = int(random.integers(max(1, min(len(content), 2000))))
    number = _HUGE[int(random.integers(len(_HUGE)))]
    return content[:start] + number + content[start + len(number) :]


def _a_piece_twice(content: bytes, random: np.random.Generator) -> bytes:
    start, end = sorted(random.integers(len(content) + 1, size=2).tolist())
    return content[:end] + content[start:]


DAMAGES: Mapping[str, Damage] = {
    "flip one bit": _flip_one,
    "flip bits of the head": _flip_in_the_head,
    "flip bits of the tail": _flip_in_the_tail,
    "flip many bits": _flip_many,
    "cut": _cut,
    "cut a little": _cut_a_little,
    "zeroed block": _zeroed_block,
    "zeroed head": _zeroed_head,
    "random bytes": _random_bytes,
    "random bytes after the head": _head_of_random_bytes,
    "huge number": _huge_number,
    "a piece twice": _a_piece_twice,
    "empty": lambda content, random: b"",
    "spaces": lambda content, random: b" \n" * 50,
    "not UTF-8": lambda content, random: b"\xff\xfe" + content,
}
