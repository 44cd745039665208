"""Rigid objects of a glTF document: equipment that moves, wheels that roll, the ground; and a document in another's."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.environment.ground_mesh import ColouredMesh
from bodycam_ros.formats.equipment_figure import EquipmentSegment, Wheel, with_creases
from bodycam_ros.formats.gltf_container import GltfBuffer, continuous_quaternions
from bodycam_ros.geometry import Array, exp_so3, quaternion_xyzw
from bodycam_ros.results.colours import linear

VERTICES, INDICES = 34962, 34963
"""Targets of views."""

_FARTHEST_TURN = np.pi / 2.0  # between two keys of a wheel: viewers take the shorter way
_Document = dict[str, Any]


def add_equipment(
    document: _Document,
    buffer: GltfBuffer,
    segments: Sequence[EquipmentSegment],
    seconds: Array,
    known: NDArray[np.bool_],
) -> list[int]:
    """Rows of nodes that are added, one a segment, with their animation.

    Args:
        document, buffer: that they are added to; it has one animation.
        segments: in metres, y up.
        seconds: (T,) of the frames.
        known: (T,) whether the pose of the equipment is known; in a gap there are no keys.
    """
    nodes, materials = document["nodes"], _Materials(document)
    times = buffer.add(seconds[known, None].astype(np.float32), with_range=True)
    rows = []
    for segment in segments:
        node: _Document = {"name": segment.name}
        if segment.meshes:
            node["mesh"] = _add_mesh(document, buffer, materials, segment.name, segment.meshes)
        nodes.append(node)
        rows.append(len(nodes) - 1)
        turns = continuous_quaternions(quaternion_xyzw(segment.rotations[known]))
        _animate(document, buffer, rows[-1], "translation", times, segment.positions[known])
        _animate(document, buffer, rows[-1], "rotation", times, turns)
        children = [_add_wheel(document, buffer, materials, wheel, seconds) for wheel in segment.wheels]
        if children:
            node["children"] = children
    return rows


def add_ground(document: _Document, buffer: GltfBuffer, ground: Sequence[ColouredMesh]) -> int:
    """Row of the node of the ground, in metres, y up, that is added."""
    mesh = _add_mesh(document, buffer, _Materials(document), "ground", ground, is_flat=True)
    document["nodes"].append({"name": "ground", "mesh": mesh})
    return len(document["nodes"]) - 1


class _Materials:
    """Matte colours of a document, each once."""

    def __init__(self, document: _Document) -> None:
        self._materials: list[_Document] = document.setdefault("materials", [])

    def row(self, colour: str) -> int:
        for row, material in enumerate(self._materials):
            if material["name"] == colour:
                return row
        matte = {"baseColorFactor": [*linear(colour), 1.0], "metallicFactor": 0.0, "roughnessFactor": 0.7}
        self._materials.append({"name": colour, "pbrMetallicRoughness": matte})
        return len(self._materials) - 1


def _add_mesh(
    document: _Document,
    buffer: GltfBuffer,
    materials: _Materials,
    name: str,
    meshes: Sequence[ColouredMesh],
    is_flat: bool = False,
) -> int:
    primitives = []
    for each in meshes:
        attributes = {}
        if is_flat:  # viewers make normals of faces where there are none
            vertices, triangles = each.vertices, each.triangles
        else:
            vertices, normals, triangles = with_creases(each)
            attributes["NORMAL"] = buffer.add(normals.astype(np.float32), VERTICES)
        attributes["POSITION"] = buffer.add(vertices.astype(np.float32), VERTICES, with_range=True)
        indices = buffer.add(triangles.reshape(-1, 1).astype(np.uint32), INDICES)
        primitives.append({"attributes": attributes, "indices": indices, "material": materials.row(each.colour)})
    document.setdefault("meshes", []).append({"name": name, "primitives": primitives})
    return len(document["meshes"]) - 1


def _add_wheel(document: _Document, buffer: GltfBuffer, materials: _Materials, wheel: Wheel, seconds: Array) -> int:
    mesh = _add_mesh(document, buffer, materials, wheel.name, wheel.meshes)
    document["nodes"].append({"name": wheel.name, "mesh": mesh, "translation": wheel.hub.tolist()})
    row = len(document["nodes"]) - 1
    if np.ptp(wheel.angles) > 0.0:
        parts = np.maximum(np.ceil(np.abs(np.diff(wheel.angles)) / _FARTHEST_TURN), 1.0).astype(int)
        frames = np.concatenate([[0.0], *(i + np.arange(1, n + 1) / n for i, n in enumerate(parts.tolist()))])
        whole = np.arange(len(seconds))
        angles = np.interp(frames, whole, wheel.angles)
        times = buffer.add(np.interp(frames, whole, seconds)[:, None].astype(np.float32), with_range=True)
        turns = continuous_quaternions(quaternion_xyzw(exp_so3(angles[:, None] * wheel.axis)))
        _animate(document, buffer, row, "rotation", times, turns)
    return row


def _animate(document: _Document, buffer: GltfBuffer, node: int, path: str, times: int, values: Array) -> None:
    animation = document["animations"][0]
    output = buffer.add(values.astype(np.float32))
    animation["samplers"].append({"input": times, "output": output, "interpolation": "LINEAR"})
    animation["channels"].append({"sampler": len(animation["samplers"]) - 1, "target": {"node": node, "path": path}})


def inside_document(ours: _Document, binary: bytes, place: _Document, place_binary: bytes) -> tuple[_Document, bytes]:
    """A document of ours as a part of another, and their binary: what the other has keeps its numbers.

    Args:
        ours, binary: with one scene and one animation.
        place, place_binary: of another program.
    """
    before = {
        key: len(place.get(key, ()))
        for key in ("nodes", "meshes", "materials", "skins", "accessors", "bufferViews", "animations")
    }
    start = len(place_binary) + -len(place_binary) % 4
    merged = {**place, "asset": {**ours["asset"], **_known_asset(place)}}
    views = [{**view, "byteOffset": view["byteOffset"] + start} for view in ours["bufferViews"]]
    for key, renumbered in {
        "accessors": [_shifted(each, before, bufferView="bufferViews") for each in ours["accessors"]],
        "bufferViews": views,
        "nodes": [
            _shifted(each, before, mesh="meshes", skin="skins")
            | ({"children": [row + before["nodes"] for row in each["children"]]} if "children" in each else {})
            for each in ours["nodes"]
        ],
        "meshes": [
            {
                **mesh,
                "primitives": [
                    _shifted(each, before, indices="accessors", material="materials")
                    | {"attributes": {name: row + before["accessors"] for name, row in each["attributes"].items()}}
                    for each in mesh["primitives"]
                ],
            }
            for mesh in ours.get("meshes", [])
        ],
        "materials": ours.get("materials", []),
        "skins": [
            _shifted(each, before, inverseBindMatrices="accessors", skeleton="nodes")
            | {"joints": [row + before["nodes"] for row in each["joints"]]}
            for each in ours.get("skins", [])
        ],
    }.items():
        merged[key] = [*place.get(key, []), *renumbered]
    animation = ours["animations"][0]
    moved = {
        **animation,
        "samplers": [_shifted(each, before, input="accessors", output="accessors") for each in animation["samplers"]],
        "channels": [
            {**each, "target": _shifted(each["target"], before, node="nodes")} for each in animation["channels"]
        ],
    }
    merged["animations"] = [moved, *place.get("animations", [])]  # viewers play the first
    scenes = [dict(scene) for scene in place.get("scenes") or [{}]]
    shown = scenes[place.get("scene", 0)]
    shown["nodes"] = [*shown.get("nodes", []), *(row + before["nodes"] for row in ours["scenes"][0]["nodes"])]
    both = place_binary + bytes(start - len(place_binary)) + binary
    buffers = place.get("buffers") or [{}]
    merged |= {"scenes": scenes, "scene": place.get("scene", 0)}
    merged["buffers"] = [{**buffers[0], "byteLength": len(both)}, *buffers[1:]]
    return {key: each for key, each in merged.items() if each != []}, both


def _known_asset(place: _Document) -> _Document:
    """What an asset says of its author, whose work the place is."""
    return {key: each for key, each in place.get("asset", {}).items() if key in ("copyright", "extras")}


def _shifted(part: _Document, before: dict[str, int], **kinds: str) -> _Document:
    """A part whose fields, which are numbers of a kind, count from where the kind begins."""
    return {**part, **{field: part[field] + before[kind] for field, kind in kinds.items() if field in part}}
