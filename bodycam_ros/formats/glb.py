"""glTF in one file: a skin on moving bones, in metres with y up, for every viewer and game engine.

In its rest pose the body stands on the ground at the origin. In a gap there are no keys: viewers interpolate.
"""

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import BodyError
from bodycam_ros.formats.character_motion import write_character
from bodycam_ros.formats.equipment_figure import equipment_segments
from bodycam_ros.formats.figure import Figure
from bodycam_ros.formats.gltf_container import GltfBuffer, continuous_quaternions, glb_chunks, glb_content
from bodycam_ros.formats.gltf_objects import INDICES, VERTICES, add_equipment, add_ground, inside_document
from bodycam_ros.formats.sampled_motion import UP_AXES, MotionOptions, SampledMotion
from bodycam_ros.formats.skinned_figure import SkinnedFigure
from bodycam_ros.formats.staged_motion import staged_motion
from bodycam_ros.geometry import quaternion_xyzw

MARK = '"generator":"bodycam_ros"'

_UP = "y"
_SKIN_COLOUR = [0.85, 0.68, 0.56, 1.0]
_MOST_BONES = 256  # rows in a byte


def write_glb(motion: SampledMotion, options: MotionOptions) -> bytes:
    """The motion as binary glTF.

    Raises:
        BodyError: two bones would have the same name, or there are more than fit in a skin; or the character that moves
            instead of the body cannot.
        SettingsError: options that a character has its own of.
    """
    if options.character is not None:
        return write_character(motion, options)
    staged = staged_motion(motion, options)
    motion = staged.motion
    skinned = SkinnedFigure.from_motion(motion, options, _UP)
    figure, has_skin = skinned.figure, len(skinned.vertices) > 0
    if len(figure.names) > _MOST_BONES:
        raise BodyError(f"{motion.name}: {len(figure.names)} bones are more than the {_MOST_BONES} of a glTF skin")
    lowest = skinned.vertices[:, 1].min() if has_skin else figure.rest[:, 1, 3].min()
    standing = np.array([0.0, -float(lowest), 0.0])
    buffer = GltfBuffer()
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
    if staged.parts:
        segments = equipment_segments(staged, options, _UP)
        inside += add_equipment(document, buffer, segments, motion.seconds, motion.equipment_known)
    if staged.ground:
        turned = [replace(each, vertices=each.vertices @ UP_AXES[_UP].T) for each in staged.ground]
        document["scenes"][0]["nodes"].append(add_ground(document, buffer, turned))
    document |= {"accessors": buffer.accessors, "bufferViews": buffer.views}
    document["buffers"] = [{"byteLength": len(buffer.content)}]
    binary = bytes(buffer.content)
    if staged.scenery is not None:
        document, binary = inside_document(document, binary, *glb_chunks(staged.scenery.content))
    return glb_content(document, binary)


def _nodes(figure: Figure, standing: NDArray[np.float64]) -> list[dict[str, Any]]:
    nodes: list[dict[str, Any]] = []
    for row, name in enumerate(figure.names):
        start = figure.offsets[row] + (standing if row == 0 else 0.0)
        node: dict[str, Any] = {"name": name, "translation": start.tolist()}
        if children := figure.children(row):
            node["children"] = children
        nodes.append(node)
    return nodes


def _animation(motion: SampledMotion, figure: Figure, buffer: GltfBuffer) -> dict[str, Any]:
    known = motion.known
    times = buffer.add(motion.seconds[known, None].astype(np.float32), with_range=True)
    outputs = [buffer.add(figure.positions[known, 0].astype(np.float32))]
    channels = [{"sampler": 0, "target": {"node": 0, "path": "translation"}}]
    for row in range(len(figure.names)):
        outputs.append(
            buffer.add(continuous_quaternions(quaternion_xyzw(figure.local_rotations[known, row])).astype(np.float32))
        )
        channels.append({"sampler": row + 1, "target": {"node": row, "path": "rotation"}})
    samplers = [{"input": times, "output": output, "interpolation": "LINEAR"} for output in outputs]
    return {"samplers": samplers, "channels": channels}


def _skinned(skinned: SkinnedFigure, standing: NDArray[np.float64], buffer: GltfBuffer) -> dict[str, Any]:
    figure = skinned.figure
    # Bones have no rotation in the rest pose; matrices are column-major.
    bind = np.tile(np.eye(4, dtype=np.float32), (len(figure.names), 1, 1))
    bind[:, 3, :3] = -(figure.rest[:, :3, 3] + standing)
    vertices = (skinned.vertices + standing).astype(np.float32)
    primitive = {
        "attributes": {
            "POSITION": buffer.add(vertices, VERTICES, with_range=True),
            "NORMAL": buffer.add(skinned.normals.astype(np.float32), VERTICES),
            "JOINTS_0": buffer.add(skinned.joints.astype(np.uint8), VERTICES),
            "WEIGHTS_0": buffer.add(skinned.weights.astype(np.float32), VERTICES),
        },
        "indices": buffer.add(skinned.triangles.reshape(-1, 1).astype(np.uint32), INDICES),
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
