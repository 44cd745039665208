"""The container of glTF: a JSON document and one binary, and the arrays (accessors) that one says are in the other."""

import json
import struct
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array

MAGIC = b"glTF"

_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_KINDS = {np.dtype("<f4"): 5126, np.dtype("u1"): 5121, np.dtype("<u4"): 5125}  # componentType
_SHAPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_DTYPES = {5120: "<i1", 5121: "<u1", 5122: "<i2", 5123: "<u2", 5125: "<u4", 5126: "<f4"}
_WIDTHS = {"SCALAR": 1, "VEC2": 2, "VEC3": 3, "VEC4": 4, "MAT4": 16}


def glb_chunks(content: bytes) -> tuple[Any, bytes]:
    """The document and the binary of a GLB.

    Raises:
        ValueError: it is cut off, or its document is no JSON.
    """
    document = None
    binary = b""
    at = 12
    while at + 8 <= len(content):
        length, kind = struct.unpack_from("<II", content, at)
        part = content[at + 8 : at + 8 + length]
        if len(part) < length:
            raise ValueError(f"it ends {length - len(part)} bytes too early")
        if kind == _JSON:
            document = json.loads(part, parse_constant=_refuse_constant)
        elif kind == _BINARY and not binary:
            binary = part
        at += 8 + length
    return document, binary


def _refuse_constant(name: str) -> float:
    raise ValueError(f"it has {name} in place of a number")


def accessor_values(document: Any, buffers: Sequence[bytes], number: int) -> Array:
    """The numbers (N, width) of an accessor; whole ones as shares of the largest, as animations have them.

    Raises:
        ValueError: they are not in the buffer, or not finite.
        KeyError, IndexError, TypeError: the document lacks a part.
    """
    accessor = document["accessors"][number]
    view = document["bufferViews"][accessor["bufferView"]]
    dtype = np.dtype(_DTYPES[accessor["componentType"]])
    width = _WIDTHS[accessor["type"]]
    count = accessor["count"]
    start = view.get("byteOffset", 0) + accessor.get("byteOffset", 0)
    stride = view.get("byteStride", 0) or dtype.itemsize * width
    content = buffers[view.get("buffer", 0)]
    if not isinstance(count, int):
        raise ValueError(f"its numbers {number} are not so many: {count!r}")
    needed = start + stride * (count - 1) + dtype.itemsize * width
    if not 0 < count or not 0 <= start or needed > len(content) or stride < dtype.itemsize * width:
        raise ValueError(f"its numbers {number} are not in its buffer")
    rows = np.lib.stride_tricks.as_strided(
        np.frombuffer(content, np.uint8, offset=start), (count, dtype.itemsize * width), (stride, 1)
    )
    with np.errstate(invalid="ignore"):  # what is no number is refused below
        values = np.ascontiguousarray(rows).view(dtype).astype(np.float64)
    if dtype.kind in "iu":
        values = np.maximum(values / np.iinfo(dtype).max, -1.0)  # normalised, as animations have them
    if not np.isfinite(values).all():
        raise ValueError(f"its numbers {number} are not finite")
    return values


class GltfBuffer:
    """Arrays one after the other, and the views and accessors of each.

    Args:
        content, views, accessors: of a file that arrays are added to.
    """

    def __init__(
        self, content: bytes = b"", views: Sequence[dict[str, int]] = (), accessors: Sequence[dict[str, Any]] = ()
    ) -> None:
        self.content = bytearray(content)
        self.views = [*views]
        self.accessors = [*accessors]

    def add(self, array: NDArray[Any], target: int | None = None, with_range: bool = False) -> int:
        """Row of the accessor of an array (N, K)."""
        self.content += bytes(-len(self.content) % 4)
        view = {"buffer": 0, "byteOffset": len(self.content), "byteLength": array.nbytes}
        self.views.append(view if target is None else {**view, "target": target})
        self.content += np.ascontiguousarray(array).astype(array.dtype.newbyteorder("<")).tobytes()
        accessor = {
            "bufferView": len(self.views) - 1,
            "componentType": _KINDS[array.dtype],
            "count": len(array),
            "type": _SHAPES[array.shape[1]],
        }
        if with_range:
            accessor |= {"min": array.min(axis=0).tolist(), "max": array.max(axis=0).tolist()}
        self.accessors.append(accessor)
        return len(self.accessors) - 1


def continuous_quaternions(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """(T, 4) each of the two quaternions of a rotation that is nearer to the one before."""
    turned_over = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    signs = np.where(np.cumsum(turned_over) % 2, -1.0, 1.0)
    continuous: NDArray[np.float64] = quaternions * np.concatenate([[1.0], signs])[:, None]
    return continuous


def glb_content(document: dict[str, Any], binary: bytes) -> bytes:
    """A GLB of a document and its binary.

    Raises:
        ValueError: a number in the document is not finite.
    """
    text = json.dumps(document, separators=(",", ":"), allow_nan=False).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    chunks = struct.pack("<II", len(text), _JSON) + text + struct.pack("<II", len(binary), _BINARY) + binary
    return struct.pack("<4sII", MAGIC, 2, 12 + len(chunks)) + chunks
