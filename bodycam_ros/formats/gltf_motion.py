"""glTF's first animation as truth: joints of a skin, or animated nodes, over time; y up, metres (glTF 2.0).

Samplers may be linear, stepped or cubic; all are sampled at the times of the one with the most of them.
"""

import base64
import binascii
import json
import struct
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation, Slerp

from bodycam_ros.errors import RecordingError
from bodycam_ros.files.yaml_file import read_bytes
from bodycam_ros.formats.captured_motion import MOST_BYTES, Y_UP_TO_Z_UP, CapturedMotion, checked_stamps
from bodycam_ros.formats.gltf_container import MAGIC, accessor_values, glb_chunks
from bodycam_ros.geometry import Array, nearest_rotation

_REST = {"translation": (0.0, 0.0, 0.0), "rotation": (0.0, 0.0, 0.0, 1.0), "scale": (1.0, 1.0, 1.0)}
_MOST_NODES, _MOST_VALUES = 10_000, 100_000_000
_DATA = "base64,"


def read_gltf(path: Path) -> CapturedMotion:
    """Joints by the names of their nodes, with rotations.

    Raises:
        RecordingError: it cannot be read.
        ValueError: it is no glTF with an animation.
    """
    content = read_bytes(path, "glTF file", RecordingError, MOST_BYTES)
    try:
        document, binary = glb_chunks(content) if content[:4] == MAGIC else (json.loads(content), b"")
        return _motion(path, document, binary)
    except (KeyError, IndexError, TypeError, AttributeError, struct.error, RecursionError) as error:
        raise ValueError(f"a part of it is missing or of another kind: {error}") from error


def _motion(path: Path, document: Any, binary: bytes) -> CapturedMotion:
    nodes: Sequence[Mapping[str, Any]] = document["nodes"]
    if not document.get("animations"):
        raise ValueError("it has no animation; export it with one")
    if len(nodes) > _MOST_NODES:
        raise ValueError(f"it has {len(nodes)} nodes; a person has some hundreds")
    buffers = [_buffer(path, buffer, binary) for buffer in document.get("buffers", [])]
    animation = document["animations"][0]
    samplers = [
        (
            *(accessor_values(document, buffers, sampler[key]) for key in ("input", "output")),
            sampler.get("interpolation", ""),
        )
        for sampler in animation["samplers"]
    ]
    animated = {
        (channel["target"]["node"], channel["target"]["path"]): samplers[channel["sampler"]]
        for channel in animation["channels"]
        if channel["target"].get("path") in _REST and "node" in channel["target"]
    }
    if not animated:
        raise ValueError("its first animation moves no node")
    seconds = max((sampler[0][:, 0] for sampler in animated.values()), key=len)
    parents = {child: number for number, node in enumerate(nodes) for child in node.get("children", [])}
    chosen = dict.fromkeys(joint for skin in document.get("skins", []) for joint in skin["joints"]) or dict.fromkeys(
        node for node, _ in animated
    )
    if len(nodes) * len(seconds) * 16 > _MOST_VALUES:
        raise ValueError(f"{len(nodes)} nodes at {len(seconds)} times are more than can be read")
    world: dict[int, Array] = {}
    points, rotations = dict[str, Array](), dict[str, Array]()
    names = {number: str(nodes[number].get("name") or f"node {number}") for number in chosen}
    if len(set(names.values())) < len(names):
        raise ValueError("two joints have the same name")
    for number, name in names.items():
        T = _world(number, nodes, parents, animated, seconds, world)
        points[name] = T[:, :3, 3] @ Y_UP_TO_Z_UP.T
        rotations[name] = Y_UP_TO_Z_UP @ np.stack([nearest_rotation(R) for R in T[:, :3, :3]])
    above = {names[n]: names[parents[n]] for n in names if n in parents and parents[n] in names}
    return CapturedMotion(path, "glTF", checked_stamps(seconds), points, rotations, above)


def _buffer(path: Path, buffer: Mapping[str, Any], binary: bytes) -> bytes:
    """The bytes of a buffer: of the GLB, in the JSON, or in a file beside it."""
    uri = buffer.get("uri")
    if uri is None:
        return binary
    if uri.startswith("data:"):
        try:
            return base64.b64decode(uri[uri.index(_DATA) + len(_DATA) :], validate=True)
        except (ValueError, binascii.Error) as error:
            raise ValueError("a buffer in it is no base64") from error
    if Path(uri).name != uri:
        raise ValueError(f"a buffer is in another folder ({uri[:100]}); put it beside the file")
    return read_bytes(path.parent / uri, "buffer of a glTF", RecordingError, MOST_BYTES)


_Animated = Mapping[tuple[int, str], tuple[Array, Array, str]]


def _world(
    number: int, nodes: Sequence[Any], parents: Mapping[int, int], animated: _Animated, seconds: Array,
    known: dict[int, Array],
) -> Array:  # fmt: skip
    """World pose with scale (K, 4, 4) of a node."""
    chain, at = list[int](), number
    while at not in known:
        if at in chain:
            raise ValueError("a node is its own ancestor")
        chain.append(at)
        if at not in parents:
            break
        at = parents[at]
    for node in reversed(chain):
        local = _local(node, nodes[node], animated, seconds)
        known[node] = known[parents[node]] @ local if node in parents else local
    return known[number]


def _local(number: int, node: Mapping[str, Any], animated: _Animated, seconds: Array) -> Array:
    """Pose with scale (K, 4, 4) of a node in its parent."""
    if "matrix" in node:
        return np.tile(np.reshape(np.array(node["matrix"], np.float64), (4, 4)).T, (len(seconds), 1, 1))
    parts = {}
    for part, rest in _REST.items():
        sampler = animated.get((number, part))
        value = np.tile(np.array(node.get(part, rest), np.float64), (len(seconds), 1))
        parts[part] = value if sampler is None else _sampled(*sampler, seconds, part == "rotation")
    T = np.tile(np.eye(4), (len(seconds), 1, 1))
    T[:, :3, :3] = Rotation.from_quat(parts["rotation"]).as_matrix() * parts["scale"][:, None]
    T[:, :3, 3] = parts["translation"]
    return T


def _sampled(times: Array, values: Array, interpolation: str, seconds: Array, is_rotation: bool) -> Array:
    """Values (K, width) of a sampler at times (K,) [s]; the first and last ones outside."""
    times = times[:, 0]
    if interpolation == "CUBICSPLINE":
        values = values[1::3]  # without the tangents: exact at its own times
    if len(values) != len(times) or not (np.diff(times) > 0.0).all():
        raise ValueError("a sampler has as many times as values, which increase; it has not")
    at = np.clip(seconds, times[0], times[-1])
    if interpolation == "STEP" or len(times) == 1:
        return np.asarray(values[np.clip(np.searchsorted(times, at, side="right") - 1, 0, len(times) - 1)], np.float64)
    if is_rotation:
        return np.asarray(Slerp(times, Rotation.from_quat(values))(at).as_quat(), np.float64)
    return np.stack([np.interp(at, times, column) for column in values.T], axis=1)
