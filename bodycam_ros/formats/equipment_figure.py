"""Equipment in a program's axes: rigid parts on moving segments, and wheels that roll."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.surface import Faces, face_normals
from bodycam_ros.environment.ground_mesh import ColouredMesh
from bodycam_ros.environment.machines import COLOURS, WHEEL_M, Part
from bodycam_ros.formats.sampled_motion import UP_AXES, MotionOptions, change_axes
from bodycam_ros.formats.staged_motion import StagedMotion
from bodycam_ros.geometry import Array

_CREASE = np.cos(np.radians(40.0))  # faces that meet at a sharper edge do not share a normal


@dataclass(frozen=True, eq=False)
class Wheel:
    """Parts that turn about an axle.

    Attributes:
        name: of the file's object.
        hub: (3,) on its segment, in units of the file.
        axis: (3,) unit, on its segment, about which it rolls forward.
        angles: (T,) that it has turned [rad].
        meshes: from its hub.
    """

    name: str
    hub: Array
    axis: Array
    angles: Array
    meshes: tuple[ColouredMesh, ...]


@dataclass(frozen=True, eq=False)
class EquipmentSegment:
    """One segment of the equipment over T frames; lengths in units of the file, in the program's axes.

    Attributes:
        name: of the segment.
        positions: (T, 3).
        rotations: (T, 3, 3).
        meshes: that move with it, one a colour.
        wheels: on it.
    """

    name: str
    positions: Array
    rotations: Array
    meshes: tuple[ColouredMesh, ...]
    wheels: tuple[Wheel, ...]


def equipment_segments(staged: StagedMotion, options: MotionOptions, up: str) -> list[EquipmentSegment]:
    """Segments of the equipment that have parts, in axes of which one is up unless the options change it."""
    program_R_world, scale = UP_AXES[options.up or up], options.scale or 1.0
    motion, made = staged.motion, []
    for segment in dict.fromkeys(part.segment for part in staged.parts):
        poses = motion.segment_poses(segment)
        own = [part for part in staged.parts if part.segment == segment]
        hubs: dict[tuple[float, ...], list[Part]] = {}
        for part in own:
            if part.hub is not None:
                hubs.setdefault(tuple(part.hub.tolist()), []).append(part)
        wheels = []
        for number, (hub, parts) in enumerate(hubs.items(), start=1):
            place = np.array(hub)
            wheels.append(
                Wheel(
                    name=f"{segment}_wheel_{number}",
                    hub=scale * program_R_world @ place,
                    axis=program_R_world @ np.array([0.0, 1.0, 0.0]),
                    angles=staged.rolled / WHEEL_M,
                    meshes=_meshes(parts, place, program_R_world, scale),
                )
            )
        made.append(
            EquipmentSegment(
                name=segment,
                positions=scale * poses[:, :3, 3] @ program_R_world.T,
                rotations=change_axes(program_R_world, poses[:, :3, :3]),
                meshes=_meshes([part for part in own if part.hub is None], np.zeros(3), program_R_world, scale),
                wheels=tuple(wheels),
            )
        )
    return made


def _meshes(parts: Sequence[Part], origin: Array, program_R_world: Array, scale: float) -> tuple[ColouredMesh, ...]:
    return tuple(
        ColouredMesh(scale * (part.vertices - origin) @ program_R_world.T, part.triangles, COLOURS[part.colour])
        for part in parts
    )


def with_creases(mesh: ColouredMesh) -> tuple[Array, Array, Faces]:
    """Vertices (V, 3), their unit normals (V, 3) and triangles (T, 3): smooth where faces meet at a blunt edge."""
    across = face_normals(mesh.vertices, mesh.triangles)
    facing = across / np.maximum(np.linalg.norm(across, axis=1, keepdims=True), 1e-12)
    owners = mesh.triangles.ravel()  # of each corner; its face is the row over three
    order = np.argsort(owners, kind="stable")
    counts = np.bincount(owners, minlength=len(mesh.vertices))
    firsts = np.concatenate([[0], np.cumsum(counts)[:-1]])
    around = counts[owners]
    corner = np.repeat(np.arange(len(owners)), around)
    nth: NDArray[np.intp] = np.arange(len(corner)) - np.repeat(np.cumsum(around) - around, around)
    beside = order[firsts[owners[corner]] + nth] // 3
    blunt = np.sum(facing[corner // 3] * facing[beside], axis=1) > _CREASE
    sums = np.stack([np.bincount(corner, across[beside, axis] * blunt, len(owners)) for axis in range(3)], axis=1)
    normals = sums / np.maximum(np.linalg.norm(sums, axis=1, keepdims=True), 1e-12)
    keys = np.column_stack([owners, np.round(normals, 4)])
    _, rows, back = np.unique(keys, axis=0, return_index=True, return_inverse=True)
    return mesh.vertices[owners[rows]], normals[rows], back.reshape(-1, 3).astype(np.int32)
