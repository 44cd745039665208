"""The skeleton: a frame in the scene for every segment, with its bones and joints in it.

Within a segment the farthest faces are painted first; between segments, which run into each other at the joints, the
nearest point of each pixel's ray shows. Twice as many pixels across as the picture has make its edges smooth.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

import cv2
import numpy as np
from numpy.typing import NDArray
from viser import CameraFrustumHandle, CylinderHandle, FrameHandle, IcosphereHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel, bone_ends
from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.plots.picture_style import EQUIPMENT
from bodycam_ros.plots.stick_figure import Bone, body_bones
from bodycam_ros.static_cameras.body_shape import BodySurface
from bodycam_ros.static_cameras.region_settings import RegionSettings
from bodycam_ros.static_cameras.region_tracker import RegionTracker
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.static_cameras.surface import Surface
from bodycam_ros.viewer.correction import Part
from bodycam_ros.viewer.scene_nodes import SELECTED, UNKNOWN, WORLD, place, rgb, segment_name, segment_rgb, when_clicked

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


Image = NDArray[np.uint8]

_LIGHT = np.array([-0.35, -0.75, -0.55]) / np.linalg.norm([-0.35, -0.75, -0.55])
"""Towards the light, in the camera's axes: above the viewer's left shoulder."""

_SHADE, _LIT = 0.55, 1.12  # of a face turned from the light, and towards it
_FINER = 2
_FAR_PX = 8000.0  # OpenCV's coordinates are 32 bits
_NEAREST_M = 0.03  # what is nearer fills the picture, and belongs to the camera's own mount
_LONGEST_PX = 400.0  # of a face's side: longer ones cross the rim of a fisheye's field
_FLAT = -1e-6  # cosine between a ray and a face along it


def paint_body(
    picture: Image,
    surfaces: Mapping[str, Surface],
    world_T_segment: Mapping[str, Array],
    colours: Mapping[str, tuple[int, int, int]],
    world_T_camera: Array,
    lens: CameraModel,
    opacity: float = 1.0,
) -> None:
    """Paint a body over a picture (H, W, 3).

    Args:
        picture: that it is painted into.
        surfaces: segment -> its surface.
        world_T_segment: segment -> (4, 4) where it is [m].
        colours: segment -> its colour, in the order of the picture's channels.
        world_T_camera: (4, 4) of the camera's optical frame [m].
        lens: of the camera.
        opacity: of the body: 1 hides what is behind it.
    """
    height, width = picture.shape[:2]
    camera_T_world = inverse(world_T_camera)
    nearest = np.full((_FINER * height, _FINER * width), np.inf, np.float32)
    shown = np.zeros((*nearest.shape, 3), np.float32)
    for segment, surface in surfaces.items():
        faces = _Faces.seen(surface, camera_T_world @ world_T_segment[segment], lens)
        if len(faces.corners):
            _paint_segment(nearest, shown, faces, np.asarray(colours[segment], np.float64), lens)
    size = (width, height)
    share = cv2.resize(np.isfinite(nearest).astype(np.float32), size, interpolation=cv2.INTER_AREA)[:, :, None]
    painted = np.asarray(cv2.resize(shown, size, interpolation=cv2.INTER_AREA), np.float32)
    picture[:] = np.clip((1.0 - opacity * share) * picture + opacity * painted, 0.0, 255.0).astype(np.uint8)


@dataclass(frozen=True, eq=False)
class _Faces:
    """Faces that turn to the camera and that it sees, the farthest first, in the camera's axes.

    Attributes:
        corners: (F, 3, 2) in the finer picture [px].
        normals: (F, 3)
        offsets: (F,) of their planes along the normals [m].
        depths: (F, 2) from the camera to their nearest and farthest corner [m].
    """

    corners: NDArray[np.int32]
    normals: Array
    offsets: Array
    depths: Array

    @classmethod
    def seen(cls, surface: Surface, camera_T_segment: Array, lens: CameraModel) -> "_Faces":
        towards = np.flatnonzero(surface.faces_towards(inverse(camera_T_segment)[:3, 3]))
        points = transform_points(camera_T_segment, surface.vertices)
        faces = surface.faces[towards]
        pixels = lens.project(points)[0][faces]
        with np.errstate(invalid="ignore"):
            sides = np.linalg.norm(pixels - np.roll(pixels, 1, axis=1), axis=2).max(axis=1)
            seen = np.isfinite(pixels).all(axis=(1, 2)) & (np.abs(pixels) < _FAR_PX).all(axis=(1, 2))
            seen &= sides < _LONGEST_PX
        far = np.linalg.norm(points, axis=1)[faces]
        rows = np.flatnonzero(seen & (far.min(axis=1) > _NEAREST_M))
        rows = rows[np.argsort(-far[rows].mean(axis=1))]
        normals = surface.face_normals[towards[rows]] @ camera_T_segment[:3, :3].T
        offsets = (normals * points[faces[rows, 0]]).sum(axis=1)
        corners = np.round((pixels[rows] + 0.5) * _FINER - 0.5).astype(np.int32)
        return cls(corners, normals, offsets, np.stack([far[rows].min(axis=1), far[rows].max(axis=1)], axis=1))


def _paint_segment(
    nearest: NDArray[np.float32], shown: NDArray[np.float32], faces: _Faces, colour: Array, lens: CameraModel
) -> None:
    """Paint a segment where it is nearer than what is there."""
    low = np.maximum(faces.corners.min(axis=(0, 1)), 0)
    high = np.minimum(faces.corners.max(axis=(0, 1)) + 1, [nearest.shape[1], nearest.shape[0]])
    if (high <= low).any():
        return
    numbers = np.zeros((high[1] - low[1], high[0] - low[0]), np.float32)  # whole ones, exact up to 2^24
    for number, corners in enumerate(faces.corners - low.astype(np.int32), start=1):
        cv2.fillConvexPoly(numbers, corners, float(number))
    rows, columns = np.nonzero(numbers)
    face = numbers[rows, columns].astype(int) - 1
    rays, is_seen = lens.unproject((np.stack([columns, rows], axis=1) + low + 0.5) / _FINER - 0.5)
    slope = np.minimum((rays * faces.normals[face]).sum(axis=1), _FLAT)
    # Beside its outline, which is drawn to whole pixels, a face goes no further than its corners.
    depth = np.clip(faces.offsets[face] / slope, *faces.depths[face].T)
    rows, columns = rows + low[1], columns + low[0]
    is_front = is_seen & (depth < nearest[rows, columns])
    rows, columns, face = rows[is_front], columns[is_front], face[is_front]
    nearest[rows, columns] = depth[is_front]
    lit = _SHADE + (_LIT - _SHADE) * 0.5 * (1.0 + faces.normals[face] @ _LIGHT)
    shown[rows, columns] = np.clip(lit[:, None] * colour, 0.0, 255.0)


_SIZE_M = 0.25
_LINE_M = 0.008


class StationScene:
    """Draws stations, and knows where they should see the contour of a body.

    Attributes:
        stations: by name.
    """

    def __init__(self, scene: SceneApi, stations: Mapping[str, Station]) -> None:
        self.stations = stations
        self._tracker: RegionTracker | None = None
        self._surfaces: Mapping[str, Surface] | None = None
        self._cameras: dict[str, CameraFrustumHandle] = {}
        for name, station in stations.items():
            camera = station.camera
            self._cameras[name] = scene.add_camera_frustum(
                f"{WORLD}/stations/{name}",
                2.0 * float(np.arctan2(camera.height / 2.0, camera.fy)),
                camera.width / camera.height,
                scale=_SIZE_M,
                thickness=_LINE_M,
                color=rgb(UNKNOWN),
            )
            place(self._cameras[name], station.world_T_camera)

    def contour(self, station: str, body: BodyModel, surfaces: Mapping[str, Surface], world_T_segment: Array) -> Array:
        """Pixels (N, 2) of the visible contour of a body at poses (S, 4, 4).

        Raises:
            BodyError: the surfaces are none of this body.
        """
        if self._tracker is None or self._surfaces is not surfaces:
            self._surfaces = surfaces
            self._tracker = RegionTracker(body, BodySurface.of(body, surfaces), self.stations, RegionSettings())
        pixels: Array = self._tracker.views[station].find_contour(world_T_segment).points[:, :2]
        return pixels

    def show_image(self, station: str | None, pixels: NDArray[np.uint8] | None) -> None:
        """Show an image (H, W, 3) in one station's pyramid, and none in the others."""
        for name, camera in self._cameras.items():
            camera.image = pixels if name == station else None

    def show(self, visible: bool) -> None:
        """Show or hide them all."""
        for camera in self._cameras.values():
            camera.visible = visible
