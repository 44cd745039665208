"""The skeleton: a frame in the scene for every segment, with its bones and joints in it."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from viser import CylinderHandle, FrameHandle, IcosphereHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_shape import bone_ends
from bodycam_ros.drawing.picture_style import EQUIPMENT
from bodycam_ros.drawing.stick_figure import Bone, body_bones
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.view.correction import Part
from bodycam_ros.view.scene_nodes import SELECTED, WORLD, place, rgb, segment_name, segment_rgb, when_clicked

_BONE_RADIUS_M = 0.02
_JOINT_RADIUS_M = 0.032
_EQUIPMENT_RADIUS_M = 0.014
_JOINT_SUBDIVISIONS, _BONE_SIDES = 2, 12
"""As round as such thin things need be: without a graphics card, faces and shadows are what a picture costs."""

_SHORTEST_M = 1e-3  # a bone shorter than that has no direction


class SkeletonScene:
    """Draws a body. Whatever is added under ``segment_name`` moves with that segment."""

    def __init__(self, scene: SceneApi, body: BodyModel, on_click: Callable[[Part], None]) -> None:
        self._frames: dict[str, FrameHandle] = {
            segment: scene.add_frame(segment_name(segment), show_axes=False) for segment in body.segments
        }
        self._joints: dict[str, IcosphereHandle] = {}
        for joint in body.joints:
            ball = scene.add_icosphere(
                f"{segment_name(joint.parent)}/joint_{joint.name}",
                _JOINT_RADIUS_M,
                segment_rgb(joint.child),
                subdivisions=_JOINT_SUBDIVISIONS,
                receive_shadow=False,
            )
            when_clicked(ball, partial(on_click, Part("joint", joint.name)))
            self._joints[joint.name] = ball
        self._bones: list[CylinderHandle] = [
            scene.add_cylinder(
                f"{segment_name(segment)}/bone_{number}",
                *_rod(body, segment),
                radial_segments=_BONE_SIDES,
                receive_shadow=False,
            )
            for number, (segment, _, _) in enumerate(segment_bones(body))
        ]
        self.reshape(body)

    def reshape(self, body: BodyModel) -> None:
        """Show the lengths and joints of a body."""
        for joint in body.joints:
            place(self._joints[joint.name], joint.parent_T_joint)
        for bone, (_, start, end) in zip(self._bones, segment_bones(body), strict=True):
            length = float(np.linalg.norm(end - start))
            bone.visible = length >= _SHORTEST_M
            if bone.visible:
                bone.height = length
                place(bone, _halfway(start, end))

    def pose(self, body: BodyModel, world_T_segment: Array) -> None:
        """Show the segments at their poses (S, 4, 4)."""
        for segment, world_T_one in zip(body.segments, world_T_segment, strict=True):
            place(self._frames[segment], world_T_one)

    def select(self, body: BodyModel, part: Part | None) -> None:
        """Show which joint is selected."""
        for joint in body.joints:
            is_selected = part == Part("joint", joint.name)
            self._joints[joint.name].color = rgb(SELECTED) if is_selected else segment_rgb(joint.child)


def _rod(body: BodyModel, segment: str) -> tuple[float, float, tuple[int, int, int]]:
    """Radius, length to begin with, and colour of a line of a segment."""
    if segment in body.equipment_segments:
        return _EQUIPMENT_RADIUS_M, 1.0, rgb(EQUIPMENT)
    return _BONE_RADIUS_M, 1.0, segment_rgb(segment)


def segment_bones(body: BodyModel) -> list[tuple[str, Array, Array]]:
    """Segment, start (3,) and end (3,) of each line of the body, in that segment's frame [m]."""
    root_T_segment = body.n_pose(np.eye(4))
    lines = []
    for bone in body_bones(body, root_T_segment):
        segment_T_root = inverse(root_T_segment[body.segment_index[bone.segment]])
        start, end = transform_points(segment_T_root, np.concatenate([bone.start, bone.end]))
        lines.append((bone.segment, start, end))
    # A last segment whose tip nobody knows, as the shin of legs alone, is drawn as far as its cameras tell.
    drawn = {segment for segment, _, _ in lines}
    for segment in body.segments:
        if segment not in drawn and segment not in body.equipment_segments:
            lines.append((segment, np.zeros(3), (bone_ends(body, segment) or [np.zeros(3)])[0]))
    return lines


def limbs_of(body: BodyModel, world_T_segment: Array) -> list[Bone]:
    """The lines of the body at one instant [m]."""
    limbs = []
    for segment, start, end in segment_bones(body):
        if np.linalg.norm(end - start) < _SHORTEST_M:
            continue
        ends = transform_points(world_T_segment[body.segment_index[segment]], np.stack([start, end]))
        limbs.append(Bone(segment, ends[:1], ends[1:], segment in body.equipment_segments))
    return limbs


class LineScene:
    """Draws so many lines of what stands beside the body, or of another one."""

    def __init__(self, scene: SceneApi, name: str, count: int, colour: str = EQUIPMENT) -> None:
        self._rods = [
            scene.add_cylinder(f"{WORLD}/{name}/line_{number}", _EQUIPMENT_RADIUS_M, 1.0, rgb(colour))
            for number in range(count)
        ]

    def show(self, lines: Sequence[Bone]) -> None:
        """Show all lines, at one instant, or none of them."""
        for rod in self._rods:
            rod.visible = bool(lines)
        for rod, line in zip(self._rods, lines, strict=False):
            rod.height = float(np.linalg.norm(line.end[0] - line.start[0]))
            place(rod, _halfway(line.start[0], line.end[0]))


def _halfway(start: Array, end: Array) -> Array:
    """(4, 4) pose in the middle of a line whose z axis is along it: a cylinder's."""
    z = (end - start) / np.linalg.norm(end - start)
    x = np.cross(z, np.eye(3)[np.argmin(np.abs(z))])
    x /= np.linalg.norm(x)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([x, np.cross(z, x), z], axis=1)
    pose[:3, 3] = (start + end) / 2.0
    return pose
