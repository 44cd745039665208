"""Damage to the arrays of a map: what a zip archive and NumPy's headers can claim, and arrays that do not fit."""

import io
import struct
import zipfile
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from faults.byte_damage import Damage

Arrays = dict[str, Any]


def _arrays(content: bytes) -> Arrays:
    with np.load(io.BytesIO(content)) as arrays:
        return {name: arrays[name] for name in arrays.files}


def _archive(members: Mapping[str, bytes]) -> bytes:
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, member in members.items():
            archive.writestr(name, member)
    return file.getvalue()


def _altered(alter: Callable[[Arrays, np.random.Generator], object]) -> Damage:
    """Other arrays in a sound archive."""

    def damage(content: bytes, random: np.random.Generator) -> bytes:
        arrays = _arrays(content)
        alter(arrays, random)
        file = io.BytesIO()
        np.savez(file, **arrays)
        return file.getvalue()

    return damage


def _headed(header: bytes, name: str = "points_world", body: bytes = b"") -> Damage:
    """One array with a header of its own making."""

    def damage(content: bytes, random: np.random.Generator) -> bytes:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            members = {member: archive.read(member) for member in archive.namelist()}
        padded = header.ljust(118) + b"\n"
        members[f"{name}.npy"] = b"\x93NUMPY\x01\x00" + struct.pack("<H", len(padded)) + padded + body
        return _archive(members)

    return damage


def _flagged(offset_local: int, offset_central: int, value: bytes) -> Damage:
    """Overwrite a field of the first member's local and central header."""

    def damage(content: bytes, random: np.random.Generator) -> bytes:
        damaged = bytearray(content)
        for signature, offset in ((b"PK\x03\x04", offset_local), (b"PK\x01\x02", offset_central)):
            at = content.index(signature) + offset
            damaged[at : at + len(value)] = value
        return bytes(damaged)

    return damage


def _set(name: str, make: Callable[[Any], Any]) -> Damage:
    return _altered(lambda arrays, random: arrays.update({name: make(arrays[name])}))


def _holed(value: float) -> Damage:
    def alter(arrays: Arrays, random: np.random.Generator) -> None:
        name = ("points_world", "descriptor_size", "world_T_camera")[int(random.integers(3))]
        arrays[name].reshape(-1)[int(random.integers(arrays[name].size))] = value

    return _altered(alter)


def _bomb(content: bytes, random: np.random.Generator) -> bytes:
    """A gigabyte of zeros in a megabyte."""
    with zipfile.ZipFile(io.BytesIO(content)) as archive:
        members = {member: archive.read(member) for member in archive.namelist()}
    members["descriptors.npy"] = members["descriptors.npy"][:128] + bytes(1 << 29)
    return _archive(members)


DAMAGES: Mapping[str, Damage] = {
    "encrypted": _flagged(6, 8, b"\x01\x00"),
    "unknown compression": _flagged(8, 10, b"\x63\x00"),
    "another checksum": _flagged(14, 16, b"\x00\x01\x02\x03"),
    "a member of 4 gigabytes": _flagged(22, 24, b"\xfe\xff\xff\xff"),
    "an array of 240 gigabytes": _headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': (10000000000, 3), }"),
    "an array of 2^70 rows": _headed(
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (1180591620717411303424, 3), }"
    ),
    "an array of negative rows": _headed(b"{'descr': '<f8', 'fortran_order': False, 'shape': (-3, 3), }"),
    "objects": _headed(b"{'descr': '|O', 'fortran_order': False, 'shape': (3, 3), }", body=b"\x80\x04."),
    "a header that is code": _headed(b"__import__('os').abort()"),
    "a deep header": _headed(b"(" * 90 + b")" * 90),
    "a header that is no table": _headed(b"[1, 2]"),
    "an unknown dtype": _headed(b"{'descr': '<q77', 'fortran_order': False, 'shape': (3, 3), }"),
    "a zip bomb": _bomb,
    "an array less": _altered(lambda arrays, random: arrays.pop(sorted(arrays)[int(random.integers(len(arrays)))])),
    "no arrays": lambda content, random: _archive({}),
    "folders for arrays": lambda content, random: _archive({"points_world.npy/": b"", "../../odd.npy": b""}),
    "NaN": _holed(np.nan),
    "infinite": _holed(np.inf),
    "huge": _holed(1e300),
    "complex numbers": _set("points_world", lambda points: points.astype(complex)),
    "texts for numbers": _set("points_world", lambda points: points.astype(str)),
    "dates for numbers": _set("descriptor_size", lambda sizes: sizes.astype("datetime64[s]")),
    "numbers for names": _set("image_names", lambda names: np.arange(len(names))),
    "one dimension more": _set("points_world", lambda points: points[:, None]),
    "one landmark less": _set("points_world", lambda points: points[:-1]),
    "no landmarks": _altered(lambda arrays, random: arrays.update({n: a[:0] for n, a in arrays.items()})),
    "landmarks out of range": _set("descriptor_landmark", lambda rows: rows + 1),
    "landmarks below zero": _set("descriptor_landmark", lambda rows: rows.astype(np.int64) - 5),
    "landmarks in disorder": _set("descriptor_landmark", lambda rows: rows[::-1].copy()),
    "landmarks that are fractions": _set("descriptor_landmark", lambda rows: rows + 0.5),
    "poses that are none": _set("world_T_camera", lambda poses: poses * 0.0),
    "everything in one place": _set("points_world", lambda points: points * 0.0),
    "a thousand kilometres away": _set("points_world", lambda points: points + 1e6),
}
