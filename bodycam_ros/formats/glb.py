"""glTF in one file: a skin on moving bones, in metres with y up, for every viewer and game engine.

In its rest pose the body stands on the ground at the origin. In a gap there are no keys: viewers interpolate.
"""

import json
import struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import BodyError
from bodycam_ros.formats.figure import Figure
from bodycam_ros.formats.sampled_motion import MotionOptions, SampledMotion
from bodycam_ros.formats.skinned_figure import SkinnedFigure
from bodycam_ros.geometry import quaternion_xyzw

MARK = '"generator":"bodycam_ros"'

_UP = "y"
_FLOAT, _UNSIGNED_BYTE, _UNSIGNED_INT = 5126, 5121, 5125  # componentType
_VERTICES, _INDICES = 34962, 34963  # target
_JSON, _BINARY = 0x4E4F534A, 0x004E4942
_SKIN_COLOUR = [0.85, 0.68, 0.56, 1.0]
_MOST_BONES = 256  # rows in a byte
_SHAPES = {1: "SCALAR", 3: "VEC3", 4: "VEC4", 16: "MAT4"}
_KINDS = {np.dtype(np.float32): _FLOAT, np.dtype(np.uint8): _UNSIGNED_BYTE, np.dtype(np.uint32): _UNSIGNED_INT}


def write_glb(motion: SampledMotion, options: MotionOptions) -> bytes:
    """The motion as binary glTF.

    Raises:
        BodyError: two bones would have the same name, or there are more than fit in a skin.
    """
    skinned = SkinnedFigure.from_motion(motion, options, _UP)
    figure, has_skin = skinned.figure, len(skinned.vertices) > 0
    if len(figure.names) > _MOST_BONES:
        raise BodyError(f"{motion.name}: {len(figure.names)} bones are more than the {_MOST_BONES} of a glTF skin")
    lowest = skinned.vertices[:, 1].min() if has_skin else figure.rest[:, 1, 3].min()
    standing = np.array([0.0, -float(lowest), 0.0])
    buffer = _Buffer()
    nodes = _nodes(figure, standing)
    document: dict[str, Any] = {
        "asset": {"generator": "bodycam_ros", "version": "2.0"},
        "scene": 0,
        "scenes": [{"name": motion.name, "nodes": [len(nodes)]}],
        "nodes": nodes,
        "animations": [{"name": motion.name, **_animation(motion, figure, buffer)}],
    }
    inside = [0]
    if has_skin:
        document |= _skinned(skinned, standing, buffer)
        inside.append(len(nodes) + 1)
    nodes.append({"name": motion.body.name, "children": inside})
    if has_skin:
        nodes.append({"name": "skin", "mesh": 0, "skin": 0})
    document |= {"accessors": buffer.accessors, "bufferViews": buffer.views}
    document["buffers"] = [{"byteLength": len(buffer.content)}]
    return _container(document, bytes(buffer.content))


def _nodes(figure: Figure, standing: NDArray[np.float64]) -> list[dict[str, Any]]:
    nodes: list[dict[str, Any]] = []
    for row, name in enumerate(figure.names):
        start = figure.offsets[row] + (standing if row == 0 else 0.0)
        node: dict[str, Any] = {"name": name, "translation": start.tolist()}
        if children := figure.children(row):
            node["children"] = children
        nodes.append(node)
    return nodes


def _animation(motion: SampledMotion, figure: Figure, buffer: "_Buffer") -> dict[str, Any]:
    known = motion.known
    times = buffer.add(motion.seconds[known, None].astype(np.float32), with_range=True)
    outputs = [buffer.add(figure.positions[known, 0].astype(np.float32))]
    channels = [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]
    for row in range(len(figure.names)):
        outputs.append(buffer.add(_continuous(quaternion_xyzw(figure.local_rotations[known, row])).astype(np.float32)))
        channels.append({"sampler": row + 1, "target": {"node": row, "path": "rotation"}})
    samplers = [{"input": times, "output": output, "interpolation": "LINEAR"} for output in outputs]
    return {"samplers": samplers, "channels": channels}


def _skinned(skinned: SkinnedFigure, standing: NDArray[np.float64], buffer: "_Buffer") -> dict[str, Any]:
    figure = skinned.figure
    # Bones have no rotation in the rest pose; matrices are column-major.
    bind = np.tile(np.eye(4, dtype=np.float32), (len(figure.names), 1, 1))
    bind[:, 3, :3] = -(figure.rest[:, :3, 3] + standing)
    vertices = (skinned.vertices + standing).astype(np.float32)
    primitive = {
        "attributes": {
            "POSITION": buffer.add(vertices, _VERTICES, with_range=True),
            "NORMAL": buffer.add(skinned.normals.astype(np.float32), _VERTICES),
            "JOINTS_0": buffer.add(skinned.joints.astype(np.uint8), _VERTICES),
            "WEIGHTS_0": buffer.add(skinned.weights.astype(np.float32), _VERTICES),
        },
        "indices": buffer.add(skinned.triangles.reshape(-1, 1).astype(np.uint32), _INDICES),
        "material": 0,
    }
    matte = {"baseColorFactor": _SKIN_COLOUR, "metallicFactor": 0.0, "roughnessFactor": 0.8}
    return {
        "meshes": [{"name": "skin", "primitives": [primitive]}],
        "materials": [{"name": "skin", "pbrMetallicRoughness": matte}],
        "skins": [
            {
                "inverseBindMatrices": buffer.add(bind.reshape(-1, 16)),
                "joints": list(range(len(figure.names))),
                "skeleton": 0,
            }
        ],
    }


class _Buffer:
    """Arrays one after the other, and the views and accessors of each."""

    def __init__(self) -> None:
        self.content = bytearray()
        self.views: list[dict[str, int]] = []
        self.accessors: list[dict[str, Any]] = []

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


def _continuous(quaternions: NDArray[np.float64]) -> NDArray[np.float64]:
    """Each of the two quaternions of a rotation that is nearer to the one before."""
    turned_over = np.sum(quaternions[1:] * quaternions[:-1], axis=1) < 0.0
    signs = np.where(np.cumsum(turned_over) % 2, -1.0, 1.0)
    continuous: NDArray[np.float64] = quaternions * np.concatenate([[1.0], signs])[:, None]
    return continuous


def _container(document: dict[str, Any], binary: bytes) -> bytes:
    text = json.dumps(document, separators=(",", ":")).encode()
    text += b" " * (-len(text) % 4)
    binary += bytes(-len(binary) % 4)
    chunks = struct.pack("<II", len(text), _JSON) + text + struct.pack("<II", len(binary), _BINARY) + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks
