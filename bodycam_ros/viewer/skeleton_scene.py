"""The body in the scene: a frame for every segment, with its bones, joints, their names and its surface in it."""

from collections.abc import Callable, Mapping, Sequence
from functools import cache, partial
from pathlib import Path

import numpy as np
from viser import CylinderHandle, IcosphereHandle, LabelHandle, MeshHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.stick_figure import Bone, body_bones
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.picture_style import EQUIPMENT, rgb
from bodycam_ros.static_cameras.limb_mesh import capsule_surfaces
from bodycam_ros.static_cameras.surface import Surface
from bodycam_ros.static_cameras.surface_folder import surfaces_of
from bodycam_ros.viewer.correction import Part
from bodycam_ros.viewer.scene_nodes import (
    SELECTED,
    WORLD,
    add_label,
    place,
    segment_name,
    segment_rgb,
    when_clicked,
)

_BONE_RADIUS_M, _JOINT_RADIUS_M, _EQUIPMENT_RADIUS_M = 0.02, 0.032, 0.014
_JOINT_SUBDIVISIONS, _BONE_SIDES = 2, 12
"""As round as such thin things need be: without a graphics card, faces and shadows are what a picture costs."""

_SHORTEST_M = 1e-3  # a bone shorter than that has no direction


class SkeletonScene:
    """Draws a body. Whatever is added under ``segment_name`` moves with that segment.

    Attributes:
        names: labels of the joints.
    """

    def __init__(self, scene: SceneApi, body: BodyModel, on_click: Callable[[Part], None]) -> None:
        self._frames = {segment: scene.add_frame(segment_name(segment), show_axes=False) for segment in body.segments}
        self._joints: dict[str, IcosphereHandle] = {}
        self.names: list[LabelHandle] = []
        for joint in body.joints:
            name = f"{segment_name(joint.parent)}/joint_{joint.name}"
            ball = scene.add_icosphere(
                name,
                _JOINT_RADIUS_M,
                segment_rgb(joint.child),
                subdivisions=_JOINT_SUBDIVISIONS,
                receive_shadow=False,
            )
            when_clicked(ball, partial(on_click, Part("joint", joint.name)))
            self._joints[joint.name] = ball
            self.names.append(add_label(scene, f"{name}/name", joint.name))
        self._bones: list[CylinderHandle] = []
        for number, (segment, _, _) in enumerate(segment_bones(body)):
            is_equipment = segment in body.equipment_segments
            self._bones.append(
                scene.add_cylinder(
                    f"{segment_name(segment)}/bone_{number}",
                    _EQUIPMENT_RADIUS_M if is_equipment else _BONE_RADIUS_M,
                    color=rgb(EQUIPMENT) if is_equipment else segment_rgb(segment),
                    radial_segments=_BONE_SIDES,
                    receive_shadow=False,
                )
            )
        self.reshape(body)

    def reshape(self, body: BodyModel) -> None:
        """Show the lengths and joints of a body."""
        for joint in body.joints:
            place(self._joints[joint.name], joint.parent_T_joint)
        for bone, (_, start, end) in zip(self._bones, segment_bones(body), strict=True):
            _stretch(bone, start, end)

    def pose(self, body: BodyModel, world_T_segment: Array) -> None:
        """Show the segments at their poses (S, 4, 4) [m]."""
        for segment, world_T_one in zip(body.segments, world_T_segment, strict=True):
            place(self._frames[segment], world_T_one)

    def select(self, body: BodyModel, part: Part | None) -> None:
        """Show which joint is selected."""
        for joint in body.joints:
            is_selected = part == Part("joint", joint.name)
            self._joints[joint.name].color = rgb(SELECTED) if is_selected else segment_rgb(joint.child)


class LineScene:
    """Draws lines that are not of the body: its equipment."""

    def __init__(self, scene: SceneApi, name: str, count: int, colour: str) -> None:
        scene.add_frame(f"{WORLD}/{name}", show_axes=False)
        self._rods = [
            scene.add_cylinder(f"{WORLD}/{name}/line_{number}", _EQUIPMENT_RADIUS_M, color=rgb(colour))
            for number in range(count)
        ]

    def show(self, lines: Sequence[Bone]) -> None:
        """Show all lines at one time, or none of them."""
        for rod in self._rods:
            rod.visible = bool(lines)
        for rod, line in zip(self._rods, lines, strict=False):
            _stretch(rod, line.start[0], line.end[0])


def _stretch(rod: CylinderHandle, start: Array, end: Array) -> None:
    """Put a cylinder between two points (3,) of its parent [m]; hide it where it has no direction."""
    length = float(np.linalg.norm(end - start))
    rod.visible = length >= _SHORTEST_M
    if not rod.visible:
        return
    z = (end - start) / length
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    pose[:3, 3] = (start + end) / 2.0
    rod.height = length
    place(rod, pose)


def segment_bones(body: BodyModel) -> list[tuple[str, Array, Array]]:
    """Segment, start (3,) and end (3,) of each line of the body, in that segment's frame [m]."""
    root_T_segment = body.n_pose(np.eye(4))
    lines = []
    for bone in body_bones(body, root_T_segment):
        segment_T_root = inverse(root_T_segment[body.segment_index[bone.segment]])
        start, end = transform_points(segment_T_root, np.concatenate([bone.start, bone.end]))
        lines.append((bone.segment, start, end))
    return lines


_OPACITY = 0.45

SurfaceReader = Callable[[BodyModel], Mapping[str, Surface]]
"""Segment -> its surface, of a body as it is corrected now."""


class SurfaceScene:
    """Draws the surface of a body; the frames of its segments move it.

    Args:
        scene: that it is added to.
        read: gives the surface of a body.

    It is made while it is visible: a correction changes the body with every move.
    """

    def __init__(self, scene: SceneApi, read: SurfaceReader) -> None:
        self._scene, self._read = scene, read
        self._body: BodyModel | None = None
        self._drawn: BodyModel | None = None
        self._meshes: list[MeshHandle] = []
        self._is_visible = False

    def reshape(self, body: BodyModel) -> None:
        """Show the surface of another body.

        Raises:
            BodyError: it cannot be used.
        """
        self._body = body
        self.show(self._is_visible)

    def show(self, visible: bool) -> None:
        """Show the surface, or hide it; raises as ``reshape``."""
        self._is_visible = visible
        if visible and self._body is not None and self._body is not self._drawn:
            self._draw(self._body)
        for mesh in self._meshes:
            mesh.visible = visible

    def _draw(self, body: BodyModel) -> None:
        surfaces = self._read(body)
        for mesh in self._meshes:
            mesh.remove()
        self._drawn = body
        self._meshes = [
            self._scene.add_mesh_simple(
                f"{segment_name(segment)}/surface",
                surface.vertices,
                surface.faces,
                color=segment_rgb(segment),
                opacity=_OPACITY,
                cast_shadow=False,
                receive_shadow=False,
            )
            for segment, surface in surfaces.items()
        ]


def surface_reader(body: BodyModel, body_path: Path, folder: Path | None) -> SurfaceReader:
    """Gives the surface of a body: capsules follow its correction; a scan is as it is, and read once.

    Args:
        body: as it was read.
        body_path: its file.
        folder: of meshes, as the user asks for.
    """
    if folder is None and body.surface is None:
        return capsule_surfaces
    scan = cache(lambda: surfaces_of(body, body_path, folder))
    return lambda corrected: scan()
