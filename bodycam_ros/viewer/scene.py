"""All that is shown: the place, the body at one state, and its cameras.

Every segment of the body is a frame, and its bones, joints, cameras and surface are nodes beneath it.
"""

from collections.abc import Callable, Mapping
from functools import cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np
from viser import CylinderHandle, SceneNodeHandle

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.body.stick_figure import body_bones
from bodycam_ros.body.surface import Surface
from bodycam_ros.body.surface_folder import surfaces_of
from bodycam_ros.geometry import Array, inverse, quaternion_xyzw, rigid, rotation_to_z, transform_points
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.camera_picture import GOOD, CameraPicture, draw_picture
from bodycam_ros.results.colours import EQUIPMENT, QUIET, WARNING, rgb, side_colour
from bodycam_ros.results.footage import Footage
from bodycam_ros.static_cameras.static_camera import Image, StaticCamera
from bodycam_ros.viewer.contacts import touching_at
from bodycam_ros.viewer.correction import Part
from bodycam_ros.viewer.motion import Motion, mounted_camera
from bodycam_ros.viewer.server import LocalServer
from bodycam_ros.viewer.viewpoint import FIELD_OF_VIEW, OpeningView, grid_lines, points_to_see

WORLD = "/world"
"""Name of the map's frame in the scene."""

REGISTERED, LOST, UNKNOWN = "#2c7f78", WARNING, QUIET
"""A camera that is registered at the time shown, one that is not, one without registrations in the recording."""

SELECTED = "#f2c200"
"""The part that is being moved; no side of the body, no state of a camera and no axis is yellow."""

TOUCHING = "#3fae2a"
"""Where a foot rests on the floor; nothing else is green."""

GRID_FINE, GRID = "#e3e7ea", "#b9c1c8"

MAP, CAMERAS, SURFACE, NAMES, CONTACTS = "map", "cameras", "surface", "names", "contacts"
"""Layers that a person can hide."""

SurfaceReader = Callable[[BodyModel], Mapping[str, Surface]]
"""Segment -> its surface, of a body as it is corrected now."""

_LANDMARKS = 100_000  # drawn at most
_LANDMARK_M, _MATCHED_M, _TOUCHING_M = 0.012, 0.03, 0.045
_AMBIENT = 1.0
_LINE_PX = 1.0
_MARGIN_M, _LEAST_M, _MOST_M = 2.0, 10.0, 60.0  # of the floor: around the place; from edge to edge
_BONE_RADIUS_M, _JOINT_RADIUS_M, _EQUIPMENT_RADIUS_M = 0.02, 0.032, 0.014
_SHORTEST_M = 1e-3  # a bone shorter than that has no direction
_OPACITY = 0.45  # of the surface
_LABEL_SCALE = 0.7

_JOINT_SUBDIVISIONS, _BONE_SIDES = 2, 12
"""As round as such thin things need be: without a graphics card, faces and shadows are what a picture costs."""

_CAMERA_FOV, _CAMERA_ASPECT = float(np.radians(60.0)), 4.0 / 3.0
"""Angle of a body camera's frustum, from top to bottom: that of a wide angle lens would hide the body."""

_SCALE, _PICTURE_SCALE, _STATIC_SCALE = 0.04, 0.08, 0.25  # of a frustum; a body camera's with an image in it is larger
_FRUSTUM_LINE_M = 0.006
_NAME_M = 0.03  # of a name along the optical axis: at the tip of the frustum a joint's name may be


def segment_name(segment: str) -> str:
    """Name of a segment's frame in the scene."""
    return f"{WORLD}/body/{segment}"


def place(handle: SceneNodeHandle, parent_T_node: Array) -> None:
    """Put a node of the scene at a pose (4, 4) in its parent [m]."""
    handle.position = parent_T_node[:3, 3]
    handle.wxyz = np.roll(quaternion_xyzw(parent_T_node[:3, :3]), 1)


class Scene:
    """Draws a body in its place.

    Attributes:
        motion: of the body, whose states are shown.
        layers: name of what can be hidden -> whether it is shown.
    """

    def __init__(
        self,
        server: LocalServer,
        body: BodyModel,
        reference_map: ReferenceMap | None,
        motion: Motion,
        on_click: Callable[[Part], None],
        stations: Mapping[str, StaticCamera] = MappingProxyType({}),
        read_surfaces: SurfaceReader = lambda body: {},
    ) -> None:
        self._server = server
        self._scene = server.scene
        self._on_click = on_click
        self._body = body
        self.motion = motion
        self._stations = stations
        self._read_surfaces = read_surfaces
        self._index, self._world_T_segment = 0, motion.segments_at(body, 0)
        self._selected: Part | None = None
        self._drawn: BodyModel | None = None  # whose surface is in the scene
        self._nodes: dict[str, list[Any]] = {layer: [] for layer in (MAP, CAMERAS, SURFACE, NAMES, CONTACTS)}
        if reference_map is None:
            del self._nodes[MAP]
        if not any(contact.points_world is not None for contact in motion.contacts):
            del self._nodes[CONTACTS]
        self.layers = {layer: layer != NAMES for layer in self._nodes}
        # Following the body moves the world past it: a browser's own camera stays under its user's hands.
        self._world = self._scene.add_frame(WORLD, show_axes=False)
        self._add_place(reference_map)
        self._add_body()
        self._add_cameras()
        self.reshape(body)

    def _add_place(self, reference_map: ReferenceMap | None) -> None:
        # Shadows and reflections take half of the time of a picture without a graphics card.
        self._scene.configure_default_lights(cast_shadow=False)
        self._scene.configure_environment_map(hdri=None)
        self._scene.add_light_ambient(f"{WORLD}/light", intensity=_AMBIENT)
        points_world = np.zeros((0, 3))
        if reference_map is not None:
            points_world = reference_map.points_world
            drawn = slice(None, None, -(-len(points_world) // _LANDMARKS) or 1)
            colours = reference_map.colours[drawn]
            self._nodes[MAP] = [self._add_points("landmarks", points_world[drawn], colours, _LANDMARK_M)]
        if reference_map is None or reference_map.gravity_aligned:
            # Not viser's grid, a shaded plane: without a graphics card it doubles the time of a picture.
            low, high = _floor(points_world)
            for name, offset_m, colour in (("half_metres", 0.5, GRID_FINE), ("metres", 0.0, GRID)):
                lines = grid_lines(low, high, offset_m).astype(np.float32)
                name = f"{WORLD}/floor/{name}"
                self._scene.add_line_segments(name, lines, rgb(colour), thickness=_LINE_PX, thickness_units="screen")
        self._matched = self._add_points("matched", np.zeros((1, 3)), rgb(GOOD), _MATCHED_M)
        self._matched.visible = False
        # Beneath a frame that a person hides: whether something touches changes with the time.
        contacts = self._scene.add_frame(f"{WORLD}/{CONTACTS}", show_axes=False)
        self._touching = self._add_points(f"{CONTACTS}/touching", np.zeros((1, 3)), rgb(TOUCHING), _TOUCHING_M)
        self._touching.visible = False
        if CONTACTS in self._nodes:
            self._nodes[CONTACTS] = [contacts]

    def _add_body(self) -> None:
        body, scene = self._body, self._scene
        self._frames = [scene.add_frame(segment_name(segment), show_axes=False) for segment in body.segments]
        self._joints = {}
        for joint in body.joints:
            name, colour = f"{segment_name(joint.parent)}/joint_{joint.name}", rgb(side_colour(joint.child))
            self._joints[joint.name] = ball = scene.add_icosphere(
                name, _JOINT_RADIUS_M, colour, subdivisions=_JOINT_SUBDIVISIONS, receive_shadow=False
            )
            self._name_part(ball, Part("joint", joint.name), 0.0)
        self._bones = [
            self._add_rod(f"{segment_name(segment)}/bone_{number}", segment, segment in body.equipment_segments)
            for number, (segment, _, _) in enumerate(segment_bones(body))
        ]
        # Equipment that the body's file does not have is the recording's, and moves by itself.
        self._equipment = [
            self._add_rod(f"{WORLD}/equipment/line_{number}", line.segment, True)
            for number, line in enumerate(self.motion.equipment)
        ]

    def _add_cameras(self) -> None:
        self._cameras = {}
        for camera, mount in self._body.mounts.items():
            name = f"{segment_name(mount.segment)}/camera_{camera}"
            self._cameras[camera] = self._add_frustum(name, _CAMERA_FOV, _CAMERA_ASPECT, _SCALE)
            self._name_part(self._cameras[camera], Part("camera", camera), _NAME_M)
        for name, station in self._stations.items():
            lens = station.camera
            field_of_view = 2.0 * float(np.arctan2(lens.height / 2.0, lens.fy))
            frustum = self._add_frustum(
                f"{WORLD}/stations/{name}", field_of_view, lens.width / lens.height, _STATIC_SCALE
            )
            place(frustum, station.world_T_camera)
            self._cameras[name] = frustum
        self._nodes[CAMERAS] = [*self._cameras.values()]

    def _add_points(self, name: str, points: Array, colours: Any, size: float) -> Any:
        style: Any = {"point_shape": "circle", "point_shading": "flat", "precision": "float32"}
        return self._scene.add_point_cloud(f"{WORLD}/{name}", points, colours, point_size=size, **style)

    def _add_rod(self, name: str, segment: str, is_equipment: bool) -> CylinderHandle:
        return self._scene.add_cylinder(
            name,
            _EQUIPMENT_RADIUS_M if is_equipment else _BONE_RADIUS_M,
            color=rgb(EQUIPMENT if is_equipment else side_colour(segment)),
            radial_segments=_BONE_SIDES,
            receive_shadow=False,
        )

    def _add_frustum(self, name: str, field_of_view: float, aspect: float, scale: float) -> Any:
        style: Any = {"variant": "filled", "cast_shadow": False, "receive_shadow": False, "thickness": _FRUSTUM_LINE_M}
        return self._scene.add_camera_frustum(name, field_of_view, aspect, scale=scale, color=rgb(UNKNOWN), **style)

    def _name_part(self, handle: Any, part: Part, ahead_m: float) -> None:
        """Make a part's node one that can be clicked, with a hidden label at a place along its z axis."""
        handle.on_click(self._server.when_pressed(partial(self._on_click, part)))
        text, name = part.name.replace("_", " "), f"{handle.name}/name"
        style: Any = {"font_screen_scale": _LABEL_SCALE, "anchor": "center-left"}
        position = (0.0, 0.0, ahead_m)
        self._nodes[NAMES].append(self._scene.add_label(name, text, position=position, visible=False, **style))

    def show(self, index: int, *, follow: bool) -> None:
        """Show the body at a state, and if it is followed, at the middle of the scene."""
        body, motion = self._body, self.motion
        self._index = index
        with self._server.atomic():
            self.pose(motion.segments_at(body, index))
            if follow:
                x, y, _ = self._world_T_segment[body.segment_index[body.root], :3, 3]
                self._world.position = (-x, -y, 0.0)
            lines = motion.equipment_at(index)
            for number, rod in enumerate(self._equipment):
                rod.visible = bool(lines)
                if lines:
                    _stretch(rod, lines[number].start[0], lines[number].end[0])
            touching = touching_at(motion.contacts, index)
            self._touching.visible = len(touching) > 0
            if len(touching):
                self._touching.points = touching.astype(np.float32)
            self._colour()

    def pose(self, world_T_segment: Array) -> None:
        """Show the body at poses (S, 4, 4) [m]."""
        self._world_T_segment = world_T_segment
        for frame, world_T_one in zip(self._frames, world_T_segment, strict=True):
            place(frame, world_T_one)

    def reshape(self, body: BodyModel) -> None:
        """Show the lengths, joints, mounts and surface of a body with the same parts.

        Raises:
            BodyError: the surface cannot be used.
        """
        self._body = body
        with self._server.atomic():
            for joint in body.joints:
                place(self._joints[joint.name], joint.parent_T_joint)
            for rod, (_, start, end) in zip(self._bones, segment_bones(body), strict=True):
                _stretch(rod, start, end)
            for camera, mount in body.mounts.items():
                place(self._cameras[camera], mount.segment_T_camera)
            self.show_layer(SURFACE, self.layers[SURFACE])

    def select(self, part: Part | None) -> None:
        """Show which part is selected; the surface is hidden meanwhile."""
        self._selected = part
        self._colour()
        self.show_layer(SURFACE, self.layers[SURFACE])

    def show_layer(self, layer: str, visible: bool) -> None:
        """Show or hide a layer; raises as ``reshape``."""
        self.layers[layer] = visible
        if layer == SURFACE:
            visible = visible and self._selected is None
            # It is made while it is visible: a correction changes the body with every move.
            if visible and self._drawn is not self._body:
                self._draw_surface()
        for node in self._nodes[layer]:
            node.visible = visible

    def _draw_surface(self) -> None:
        surfaces = self._read_surfaces(self._body)
        for mesh in self._nodes[SURFACE]:
            mesh.remove()
        self._drawn = self._body
        self._nodes[SURFACE] = [
            self._scene.add_mesh_simple(
                f"{segment_name(segment)}/surface",
                surface.vertices,
                surface.faces,
                color=rgb(side_colour(segment)),
                opacity=_OPACITY,
                cast_shadow=False,
                receive_shadow=False,
            )
            for segment, surface in surfaces.items()
        ]

    def _colour(self) -> None:
        """Give cameras the colour of their state, joints that of their side, and the selected part its own."""
        for joint in self._body.joints:
            is_selected = self._selected == Part("joint", joint.name)
            self._joints[joint.name].color = rgb(SELECTED if is_selected else side_colour(joint.child))
        for camera in self._body.mounts:
            colour = UNKNOWN
            if self._selected == Part("camera", camera):
                colour = SELECTED
            elif camera in self.motion.registered:
                colour = LOST if self.motion.registered_at(camera, self._index) is None else REGISTERED
            self._cameras[camera].color = rgb(colour)

    def frame_body(self) -> None:
        """Set the viewpoint of browsers, those that open the view and those that have it open, to the body shown."""
        points_world = points_to_see(self._body, self._world_T_segment)
        root = self._world_T_segment[self._body.segment_index[self._body.root]]
        opening = OpeningView.of_body(root, points_world + np.array(self._world.position))
        initial = self._server.initial_camera
        initial.fov = FIELD_OF_VIEW
        initial.look_at = opening.look_at
        initial.position = opening.position
        for client in self._server.get_clients().values():
            client.camera.look_at, client.camera.position = opening.look_at, opening.position

    def world_T_camera(self, camera: str) -> Array:
        """(4, 4) pose of a camera on the body as it is shown, or of a static one [m]."""
        if camera in self._stations:
            return self._stations[camera].world_T_camera
        return mounted_camera(self._body, self._world_T_segment, camera)

    def show_picture(self, camera: str | None, footage: Footage | None) -> CameraPicture | None:
        """Show a camera's image in its pyramid, with the body drawn over it; return it, None if there is none.

        Raises:
            RecordingError: the image cannot be decoded.
        """
        picture = None if footage is None or camera is None else self._picture(camera, footage)
        self.show_image(camera, None if picture is None else picture.pixels)
        self._matched.visible = picture is not None and len(picture.landmarks_world) > 0
        if picture is not None and self._matched.visible:
            self._matched.points = picture.landmarks_world.astype(np.float32)
        return picture

    def show_image(self, camera: str | None, pixels: Image | None) -> None:
        """Show an image (H, W, 3) in one camera's frustum, larger than the others; None: no camera, no image."""
        for name, frustum in self._cameras.items():
            image = pixels if name == camera else None
            if image is not None or frustum.image is not None:
                frustum.image = image
            if name in self._body.mounts:
                frustum.scale = _PICTURE_SCALE if name == camera else _SCALE

    def _picture(self, camera: str, footage: Footage) -> CameraPicture | None:
        at_ns = int(self.motion.stamps_ns[self._index])
        image = footage.image_at(camera, at_ns, self.motion.frame_ns // 2)
        if image is None:
            return None
        limbs = body_bones(self._body, self._world_T_segment) + self.motion.equipment_at(self._index)
        model, matches = footage.model(camera), footage.matches_of(image)
        return draw_picture(image, model, self.world_T_camera(camera), limbs, matches)


def _stretch(rod: CylinderHandle, start: Array, end: Array) -> None:
    """Put a cylinder between two points (3,) of its parent [m]; hide it where it has no direction."""
    length = float(np.linalg.norm(end - start))
    rod.visible = length >= _SHORTEST_M
    if not rod.visible:
        return
    rod.height = length
    place(rod, rigid(rotation_to_z((end - start) / length).T, (start + end) / 2.0))


def segment_bones(body: BodyModel) -> list[tuple[str, Array, Array]]:
    """Segment, start (3,) and end (3,) of each line of the body, in that segment's frame [m]."""
    root_T_segment = body.n_pose(np.eye(4))
    lines = []
    for bone in body_bones(body, root_T_segment):
        segment_T_root = inverse(root_T_segment[body.segment_index[bone.segment]])
        start, end = transform_points(segment_T_root, np.concatenate([bone.start, bone.end]))
        lines.append((bone.segment, start, end))
    return lines


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


def _floor(points_world: Array) -> tuple[Array, Array]:
    """Corners (2,), (2,) of a floor beneath nine tenths of the points (N, 3) and the origin, in whole metres [m].

    A few landmarks, far away through a window, are not the place.
    """
    low, high = np.quantile(np.vstack([points_world[:, :2], np.zeros((1, 2))]), (0.05, 0.95), axis=0)
    middle = np.round(0.5 * (low + high))
    half = np.ceil(np.clip(0.5 * (high - low) + _MARGIN_M, 0.5 * _LEAST_M, 0.5 * _MOST_M))
    return middle - half, middle + half
