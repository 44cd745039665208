"""Rigid objects of a USD document: equipment that moves, wheels that roll, ground, a place of another program."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.surface import Faces
from bodycam_ros.environment.ground_mesh import ColouredMesh
from bodycam_ros.environment.machines import COLOURS
from bodycam_ros.environment.scenery import Scenery
from bodycam_ros.formats.equipment_figure import EquipmentSegment, Wheel, equipment_segments, with_creases
from bodycam_ros.formats.sampled_motion import UP_AXES, MotionOptions
from bodycam_ros.formats.staged_motion import StagedMotion
from bodycam_ros.formats.usd_values import identifier, single_samples, written, written_rows
from bodycam_ros.geometry import Array, quaternion_xyzw
from bodycam_ros.results.colours import linear

SKIN = "skin"
"""Name of the person's material."""

_MATERIALS = "materials"


def usd_objects(staged: StagedMotion, options: MotionOptions, up: str) -> list[str]:
    """Prims of the equipment and of the place, in axes of which one is up unless the options change it."""
    program_R_world, scale = UP_AXES[options.up or up], options.scale or 1.0
    prims = []
    if staged.parts:
        frames = np.flatnonzero(staged.motion.equipment_known)
        inside = "".join(_segment(each, frames) for each in equipment_segments(staged, options, up))
        prims.append(_xform("equipment", "", inside))
    if staged.ground:
        flat = "".join(
            _mesh(f"part_{row}", scale * each.vertices @ program_R_world.T, each.triangles, _one(each.colour, 2))
            for row, each in enumerate(staged.ground)
        )
        prims.append(_xform("ground", "", flat))
    if staged.scenery is not None:
        prims.append(_scenery(staged.scenery, program_R_world, scale))
    return prims


def usd_materials(staged: StagedMotion, skin: Sequence[float], root: str) -> str:
    """A scope with the materials of all prims, for programs that heed no ``displayColor``, as Blender.

    Args:
        staged: what is written.
        skin: colour of the person, linear in light.
        root: name of the prim that it is in.
    """
    used = {COLOURS[part.colour] for part in staged.parts} | {each.colour for each in staged.ground}
    colours = {SKIN: skin, **{_name(colour): linear(colour) for colour in sorted(used)}}
    materials = "".join(
        f"""        def Material "{name}"
        {{
            token outputs:surface.connect = </{root}/{_MATERIALS}/{name}/surface.outputs:surface>

            def Shader "surface"
            {{
                uniform token info:id = "UsdPreviewSurface"
                color3f inputs:diffuseColor = {written(colour)}
                float inputs:roughness = 0.7
                token outputs:surface
            }}
        }}
"""
        for name, colour in colours.items()
    )
    return f"""    def Scope "{_MATERIALS}"
    {{
{materials}    }}

"""


def _segment(segment: EquipmentSegment, frames: NDArray[np.intp]) -> str:
    turns = quaternion_xyzw(segment.rotations[frames])[:, [3, 0, 1, 2]]
    moves = f"""        double3 xformOp:translate.timeSamples = {{
{single_samples(frames, segment.positions[frames])}        }}
        quatf xformOp:orient.timeSamples = {{
{single_samples(frames, turns)}        }}
        uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]
"""
    wheels = "".join(map(_wheel, segment.wheels))
    return _xform(identifier(segment.name), moves, _parts(segment.meshes, 3) + wheels)


def _wheel(wheel: Wheel) -> str:
    axis = int(np.abs(wheel.axis).argmax())
    degrees = np.degrees(wheel.angles) * np.sign(wheel.axis[axis])
    turns = "".join(f"            {frame}: {angle:.8g},\n" for frame, angle in enumerate(degrees.tolist()))
    op = f"xformOp:rotate{'XYZ'[axis]}"
    moves = f"""        double3 xformOp:translate = {written(wheel.hub.tolist())}
        float {op}.timeSamples = {{
{turns}        }}
        uniform token[] xformOpOrder = ["xformOp:translate", "{op}"]
"""
    return _xform(identifier(wheel.name), moves, _parts(wheel.meshes, 4))


def _parts(meshes: Sequence[ColouredMesh], depth: int) -> str:
    made = []
    for row, each in enumerate(meshes):
        vertices, normals, triangles = with_creases(each)
        made.append(_mesh(f"part_{row}", vertices, triangles, _one(each.colour, depth), normals))
    return "".join(made)


def _scenery(scenery: Scenery, program_R_world: Array, scale: float) -> str:
    colours = (
        f'[{written_rows(scenery.colours.astype(np.float64))}] (\n            interpolation = "uniform"\n        )'
    )
    return _mesh("place", scale * scenery.vertices @ program_R_world.T, scenery.triangles, colours)


def _one(colour: str, depth: int) -> str:
    """A colour and its material, of a prim so many below that which the materials are in."""
    return f"[{written(linear(colour))}]\n        {bound_material(_name(colour), depth)}"


def bound_material(name: str, depth: int) -> str:
    """The line of a prim, so many below that which the materials are in, with its material."""
    return f"rel material:binding = <{'../' * depth}{_MATERIALS}/{name}>"


def _name(colour: str) -> str:
    return f"c_{colour.removeprefix('#')}"


def _xform(name: str, moves: str, inside: str) -> str:
    return f"""    def Xform "{name}"
    {{
{moves}{inside}    }}

"""


def _mesh(name: str, vertices: Array, triangles: Faces, colours: str, normals: Array | None = None) -> str:
    smooth = ""
    if normals is not None:
        smooth = f"""        normal3f[] normals = [{written_rows(normals)}] (
            interpolation = "vertex"
        )
"""
    bound = ' (\n        prepend apiSchemas = ["MaterialBindingAPI"]\n    )' if "material:binding" in colours else ""
    return f"""    def Mesh "{name}"{bound}
    {{
        float3[] extent = [{written(vertices.min(axis=0).tolist())}, {written(vertices.max(axis=0).tolist())}]
        int[] faceVertexCounts = [{", ".join(["3"] * len(triangles))}]
        int[] faceVertexIndices = [{", ".join(map(str, triangles.ravel().tolist()))}]
{smooth}        point3f[] points = [{written_rows(vertices)}]
        color3f[] primvars:displayColor = {colours}
        uniform token subdivisionScheme = "none"
    }}
"""
