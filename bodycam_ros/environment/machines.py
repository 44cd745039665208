"""What equipment looks like: a bicycle with wheels that roll, a snowboard, a barbell; else tubes along its lines."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, bone_ends
from bodycam_ros.body.limb_mesh import Ball, limb_mesh
from bodycam_ros.body.surface import Faces, join_meshes
from bodycam_ros.geometry import Array, exp_so3, transform_points
from bodycam_ros.results.colours import EQUIPMENT

PAINT, RUBBER, METAL = range(3)
"""Colours of parts."""

COLOURS = EQUIPMENT, "#26282b", "#a4aab0"
"""Written colours of ``PAINT``, ``RUBBER`` and ``METAL``."""

WHEEL_M = 0.34
"""Radius of a wheel, with its tyre."""

_REAR, _FRONT = np.array([-0.41, 0.0, 0.07]), np.array([0.60, 0.0, 0.07])  # hubs, from the middle of the crank's axle
_SEAT, _SADDLE = np.array([-0.17, 0.0, 0.55]), np.array([-0.206, 0.0, 0.673])
_HEAD_LOW, _HEAD_HIGH = np.array([0.44, 0.0, 0.47]), np.array([0.375, 0.0, 0.66])
_GRIPS = {"left": (0.4, 0.22, 0.76), "right": (0.4, -0.22, 0.76)}
_BEYOND_M = 0.06  # of the bar, beyond the hands
_BRACKET = np.zeros(3)
_LINE_M = 0.014  # radius of a tube that stands for a line
_TUBE_M, _THIN_M, _TYRE_M, _SPOKE_M = 0.017, 0.009, 0.016, 0.0022
_SPOKES = 14
_BOARD_M, _WAIST_M, _THICK_M = 1.52, 0.25, 0.012
_FLAT_M, _SIDECUT_M, _RISE_M = 0.56, 0.045, 0.09  # flat from the middle on; how much wider there; how high the ends are
_SHAFT_M, _SLEEVE_M, _PALM_M, _PLATE_M = 0.655, 0.41, 0.12, (0.225, 0.06)  # plates: radius, thickness
_SOLE_M = 0.011  # half of a pedal's height

Mesh = tuple[Array, Faces]


@dataclass(frozen=True, eq=False)
class Part:
    """A rigid part of equipment.

    Attributes:
        segment: that it moves with.
        vertices, triangles: (V, 3) in the segment's frame [m], (T, 3).
        colour: one of ``PAINT``, ``RUBBER`` and ``METAL``.
        hub: (3,) of a wheel, which turns about the segment's y through it; None of others.
    """

    segment: str
    vertices: Array
    triangles: Faces
    colour: int
    hub: Array | None = None

    def placed(self, world_T_segment: Array, rolled_m: float) -> Array:
        """Vertices (V, 3) in the world, of a wheel that has rolled so far [m]."""
        vertices = self.vertices
        if self.hub is not None:
            turn = exp_so3(np.array([0.0, rolled_m / WHEEL_M, 0.0]))
            vertices = (vertices - self.hub) @ turn.T + self.hub
        return transform_points(world_T_segment, vertices)


def machine_parts(body: BodyModel, lengths: Mapping[str, float]) -> tuple[Part, ...]:
    """Parts of a bicycle, snowboard or barbell, known by the segments of their files; tubes of other equipment.

    Args:
        body: with its equipment.
        lengths: that were estimated (``EquipmentReport``): bar and saddle are where hands and pelvis found them [m].
    """
    segments = body.equipment_segments
    if {"frame", "crank", "pedal_left", "pedal_right"} <= segments:
        return tuple(_bicycle(body, lengths))
    if "board" in segments:
        return tuple(_snowboard(body))
    if segments == {"bar"}:
        return tuple(_barbell(body))
    lines = [(segment, end) for segment in sorted(segments) for end in bone_ends(body, segment)]
    return tuple(Part(segment, *_line(end), PAINT) for segment, end in lines)


def _bicycle(body: BodyModel, lengths: Mapping[str, float]) -> list[Part]:
    hands = [
        [lengths.get(f"hand_{side}_{axis}", at) for axis, at in zip("xyz", grip, strict=True)]
        for side, grip in _GRIPS.items()
    ]
    grips = np.array(hands)
    handlebar = grips.mean(axis=0) * [1.0, 0.0, 1.0]
    saddle_at = np.array([lengths.get("saddle_x", _SADDLE[0]), 0.0, lengths.get("saddle_z", _SADDLE[2])])
    side = np.array([0.0, 0.055, 0.0])
    stays = [(start, hub + sign * side) for start, hub in ((_BRACKET, _REAR), (_SEAT, _REAR)) for sign in (-1.0, 1.0)]
    forks = [(_HEAD_LOW, _FRONT + sign * side) for sign in (-1.0, 1.0)]
    main = [(_BRACKET, _SEAT), (_SEAT, _HEAD_HIGH), (_BRACKET, _HEAD_LOW), (_HEAD_LOW, _HEAD_HIGH)]
    bar = np.array([0.0, float(np.abs(grips[:, 1]).max()) + _BEYOND_M, 0.0])
    tubes = [*(_tube(*ends, _TUBE_M) for ends in main), *(_tube(*ends, _THIN_M) for ends in (*stays, *forks))]
    metal = [_tube(_SEAT, saddle_at - [0.0, 0.0, 0.04], 0.013), _tube(_HEAD_HIGH, handlebar, 0.013)]
    metal += [_tube(handlebar - bar, handlebar + bar, 0.013)]
    # One sits on its upper face.
    rubber = [_mesh(trimesh.creation.box((0.26, 0.13, 0.045)), saddle_at - [0.0, 0.0, 0.0225])]
    rubber += [_tube(handlebar + sign * bar, handlebar + 0.55 * sign * bar, 0.017) for sign in (-1.0, 1.0)]
    parts = [
        Part("frame", *join_meshes(tubes), PAINT),
        Part("frame", *join_meshes(metal), METAL),
        Part("frame", *join_meshes(rubber), RUBBER),
    ]
    for hub in (_REAR, _FRONT):
        parts.append(Part("frame", *_ring(hub, WHEEL_M - _TYRE_M, _TYRE_M), RUBBER, hub))
        angles = 2.0 * np.pi * np.arange(_SPOKES) / _SPOKES
        ends = hub + (WHEEL_M - 2.0 * _TYRE_M) * np.stack([np.cos(angles), 0.0 * angles, np.sin(angles)], axis=1)
        spokes = [_tube(hub, end, _SPOKE_M) for end in ends]
        rim = _ring(hub, WHEEL_M - 2.4 * _TYRE_M, 0.008)
        parts.append(Part("frame", *join_meshes([*spokes, rim, _tube(hub - side, hub + side, 0.016)]), METAL, hub))
    arms = [_ring(np.array([0.0, -0.045, 0.0]), 0.085, 0.006), _tube(-side, side, 0.014)]
    for pedal in ("pedal_left", "pedal_right"):
        joint = next(joint for joint in body.tree_joints if joint.child == pedal)
        spindle = joint.parent_T_joint[:3, 3]
        root = np.array([0.0, np.sign(spindle[1]) * 0.055, 0.0])
        knee = np.array([spindle[0], np.sign(spindle[1]) * 0.07, spindle[2]])
        arms += [_tube(root, knee, 0.012), _tube(knee, spindle, 0.007)]
        # Its upper face is where the sole is: at the axle.
        plate = _mesh(trimesh.creation.box((0.095, 0.09, 2.0 * _SOLE_M)), np.array([0.0, 0.0, -_SOLE_M]))
        parts.append(Part(pedal, *plate, RUBBER))
    return [*parts, Part("crank", *join_meshes(arms), METAL)]


def _snowboard(body: BodyModel) -> list[Part]:
    """Its upper face is the board's origin."""
    bindings = sorted(body.equipment_segments - {"board"})
    plate = _mesh(trimesh.creation.box((0.27, 0.12, 0.008)), np.array([0.0, 0.0, -0.004]))
    return [Part("board", *_deck(), PAINT), *(Part(binding, *plate, RUBBER) for binding in bindings)]


def _deck() -> Mesh:
    """Narrowest in the middle, with nose and tail round and bent up."""
    x = 0.5 * _BOARD_M * np.sin(np.linspace(-0.5 * np.pi, 0.5 * np.pi, 49))
    bent = np.clip((np.abs(x) - _FLAT_M) / (0.5 * _BOARD_M - _FLAT_M), 0.0, 1.0)
    half = 0.5 * (_WAIST_M + _SIDECUT_M * np.minimum(np.abs(x) / _FLAT_M, 1.0) ** 2)
    half *= np.sqrt(np.maximum(1.0 - bent**2, 1e-4))
    across = np.linspace(-1.0, 1.0, 9)
    top = np.stack(np.broadcast_arrays(x[:, None], half[:, None] * across, _RISE_M * bent[:, None] ** 2), axis=2)
    vertices = np.concatenate([top.reshape(-1, 3), (top - [0.0, 0.0, _THICK_M]).reshape(-1, 3)])
    rows = np.arange(top[..., 0].size, dtype=np.int32).reshape(top.shape[:2])
    below = rows + rows.size
    around = [(rows[:, -1], below[:, -1]), (below[:, 0], rows[:, 0]), (below[-1], rows[-1]), (rows[0], below[0])]
    faces = [_grid(rows), _grid(below)[:, ::-1]]
    faces += [_grid(np.stack(pair, axis=1)) for pair in around]
    return vertices, np.concatenate(faces)


def _grid(rows: NDArray[np.int32]) -> Faces:
    """Triangles (T, 3) of a grid of vertices, counter-clockwise where the second index is to the left of the first."""
    a, b, c, d = rows[:-1, :-1], rows[1:, :-1], rows[1:, 1:], rows[:-1, 1:]
    triangles = np.stack([np.stack([a, b, c], axis=-1), np.stack([a, c, d], axis=-1)], axis=-2)
    return triangles.reshape(-1, 3).astype(np.int32)


def _barbell(body: BodyModel) -> list[Part]:
    """Along the bar's y, with plates outside of the hands."""
    held = [abs(float(joint.parent_T_joint[1, 3])) for joint in body.loop_joints if joint.parent == "bar"]
    inside = np.array([0.0, max(_SHAFT_M, max(held, default=0.0) + _PALM_M), 0.0])
    sleeve, plate = np.array([0.0, _SLEEVE_M, 0.0]), np.array([0.0, _PLATE_M[1], 0.0])
    metal, rubber = [_tube(-inside - sleeve, inside + sleeve, 0.014)], []
    for side in (-1.0, 1.0):
        metal += [_tube(side * inside, side * (inside + sleeve), 0.025)]
        rubber += [_tube(side * (inside + 0.25 * plate), side * (inside + 1.25 * plate), _PLATE_M[0], 48)]
    return [Part("bar", *join_meshes(metal), METAL), Part("bar", *join_meshes(rubber), RUBBER)]


def _line(end: Array) -> Mesh:
    """A round tube from the origin to a point (3,)."""
    return limb_mesh(np.zeros(3), end, [Ball(0.0, _LINE_M), Ball(1.0, _LINE_M)], np.array([0.0, 0.0, 1.0]))


def _tube(start: Array, end: Array, radius: float, sections: int = 14) -> Mesh:
    return _mesh(trimesh.creation.cylinder(radius, sections=sections, segment=np.stack([start, end])), np.zeros(3))


def _ring(hub: Array, radius: float, thickness: float) -> Mesh:
    """A ring in the plane of x and z around a hub (3,)."""
    ring = trimesh.creation.torus(radius, thickness, major_sections=64, minor_sections=12)
    vertices = np.asarray(ring.vertices)[:, [0, 2, 1]] * [1.0, -1.0, 1.0]
    return hub + vertices, np.asarray(ring.faces, np.int32)


def _mesh(mesh: trimesh.Trimesh, centre: NDArray[np.float64]) -> Mesh:
    return np.asarray(mesh.vertices) + centre, np.asarray(mesh.faces, np.int32)
