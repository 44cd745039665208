"""All that is shown: the place, the body at one state, its cameras, and the browser's first viewpoint."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from viser import PointCloudHandle, SceneApi, SceneNodeHandle, ViserServer

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.stick_figure import body_bones
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import EQUIPMENT, rgb
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.camera_picture import GOOD, CameraPicture, draw_picture
from bodycam_ros.results.footage import Footage
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.viewer.camera_scene import CameraScene
from bodycam_ros.viewer.correction import Part
from bodycam_ros.viewer.motion import Motion, mounted_camera
from bodycam_ros.viewer.scene_nodes import GRID, GRID_FINE, WORLD
from bodycam_ros.viewer.skeleton_scene import LineScene, SkeletonScene, SurfaceReader, SurfaceScene

MAP, CAMERAS, SURFACE, NAMES = "map", "cameras", "surface", "names"
"""Layers that a person can hide."""

_LANDMARKS = 100_000  # drawn at most
_LANDMARK_M, _MATCHED_M = 0.012, 0.03
_AMBIENT = 1.0
_LINE_PX = 1.0
_MARGIN_M, _LEAST_M, _MOST_M = 2.0, 10.0, 60.0  # of the floor: around the place; from edge to edge


class Scene:
    """Draws a body in its place.

    Attributes:
        layers: name of what can be hidden -> whether it is shown.
    """

    def __init__(
        self,
        server: ViserServer,
        body: BodyModel,
        reference_map: ReferenceMap | None,
        motion: Motion,
        on_click: Callable[[Part], None],
        stations: Mapping[str, Station] = MappingProxyType({}),
        read_surfaces: SurfaceReader = lambda body: {},
    ) -> None:
        scene, self._server = server.scene, server
        self.motion = motion
        self._body, self._stations = body, stations
        self._index, self._world_T_segment = 0, motion.segments_at(body, 0)
        self._is_selected = False
        # Following the body moves the world past it: a browser's own camera stays under its user's hands.
        self._world = scene.add_frame(WORLD, show_axes=False)
        _add_light(scene)
        if reference_map is None or reference_map.gravity_aligned:
            _add_floor(scene, np.zeros((0, 3)) if reference_map is None else reference_map.points_world)
        self._skeleton = SkeletonScene(scene, body, on_click)
        self._cameras = CameraScene(scene, body, on_click, stations)
        self._surface = SurfaceScene(scene, read_surfaces)
        self._equipment = LineScene(scene, "equipment", len(motion.equipment), EQUIPMENT)
        self._matched = _add_points(scene, "matched", np.zeros((1, 3)), rgb(GOOD), _MATCHED_M)
        self._matched.visible = False
        self._nodes: dict[str, Sequence[SceneNodeHandle]] = {}
        if reference_map is not None:
            drawn = slice(None, None, -(-len(reference_map.points_world) // _LANDMARKS) or 1)
            points, colours = reference_map.points_world[drawn], reference_map.colours[drawn]
            self._nodes[MAP] = [_add_points(scene, "landmarks", points, colours, _LANDMARK_M)]
        self._nodes[CAMERAS] = self._cameras.nodes
        self._nodes[SURFACE] = []
        self._nodes[NAMES] = [*self._skeleton.names, *self._cameras.names]
        self.layers = {layer: layer != NAMES for layer in self._nodes}
        self._surface.reshape(body)
        self.show_layer(SURFACE, self.layers[SURFACE])

    def show(self, index: int, *, follow: bool) -> None:
        """Show the body at a state, and if it is followed, at the middle of the scene."""
        body, motion = self._body, self.motion
        self._index = index
        with self._server.atomic():
            self.pose(motion.segments_at(body, index))
            if follow:
                x, y, _ = self._world_T_segment[body.segment_index[body.root], :3, 3]
                self._world.position = (-x, -y, 0.0)
            self._equipment.show(motion.equipment_at(index))
            for camera in motion.registered:
                self._cameras.show_registered(camera, motion.registered_at(camera, index) is not None)

    def pose(self, world_T_segment: Array) -> None:
        """Show the body at poses (S, 4, 4) [m]."""
        self._world_T_segment = world_T_segment
        self._skeleton.pose(self._body, world_T_segment)

    def reshape(self, body: BodyModel) -> None:
        """Show the lengths, joints, mounts and surface of a body with the same parts.

        Raises:
            BodyError: the surface cannot be used.
        """
        self._body = body
        with self._server.atomic():
            self._skeleton.reshape(body)
            self._cameras.reshape(body)
            self._surface.reshape(body)
        self.show_layer(SURFACE, self.layers[SURFACE])

    def select(self, part: Part | None) -> None:
        """Show which part is selected; the surface is hidden meanwhile."""
        self._skeleton.select(self._body, part)
        self._cameras.select(part)
        self._is_selected = part is not None
        self.show_layer(SURFACE, self.layers[SURFACE])

    def show_layer(self, layer: str, visible: bool) -> None:
        """Show or hide a layer."""
        self.layers[layer] = visible
        if layer == SURFACE:
            self._surface.show(visible and not self._is_selected)
        for node in self._nodes[layer]:
            node.visible = visible

    def frame_body(self) -> None:
        """Set the viewpoint of browsers, those that open the view and those that have it open, to the body shown."""
        points_world = points_to_see(self._body, self._world_T_segment)
        root = self._world_T_segment[self._body.segment_index[self._body.root]]
        opening = OpeningView.of_body(root, points_world + np.array(self._world.position))
        initial = self._server.initial_camera
        initial.fov, initial.look_at, initial.position = FIELD_OF_VIEW, opening.look_at, opening.position
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
        self._cameras.show_image(camera, None if picture is None else picture.pixels)
        self._matched.visible = picture is not None and len(picture.landmarks_world) > 0
        if picture is not None and self._matched.visible:
            self._matched.points = picture.landmarks_world.astype(np.float32)
        return picture

    def _picture(self, camera: str, footage: Footage) -> CameraPicture | None:
        at_ns = int(self.motion.stamps_ns[self._index])
        image = footage.image_at(camera, at_ns, self.motion.frame_ns // 2)
        if image is None:
            return None
        limbs = body_bones(self._body, self._world_T_segment) + self.motion.equipment_at(self._index)
        model, matches = footage.model(camera), footage.matches_of(image)
        return draw_picture(image, model, self.world_T_camera(camera), limbs, matches)


def _add_light(scene: SceneApi) -> None:
    """Light without shadows and reflections, which take half of the time of a picture without a graphics card."""
    scene.configure_default_lights(cast_shadow=False)
    scene.configure_environment_map(hdri=None)
    scene.add_light_ambient(f"{WORLD}/light", intensity=_AMBIENT)


def _add_points(
    scene: SceneApi, name: str, points: Array, colours: NDArray[np.uint8] | tuple[int, int, int], size: float
) -> PointCloudHandle:
    return scene.add_point_cloud(
        f"{WORLD}/{name}",
        points,
        colours,
        point_size=size,
        point_shape="circle",
        point_shading="flat",
        precision="float32",
    )


def _add_floor(scene: SceneApi, points_world: Array) -> None:
    """Add the floor, z = 0, beneath nine tenths of the points (N, 3) of the place and the origin [m]; N may be 0.

    Lines and not viser's grid, a shaded plane: without a graphics card it doubles the time of a picture.
    """
    # A few landmarks, far away through a window, are not the place.
    low, high = np.quantile(np.vstack([points_world[:, :2], np.zeros((1, 2))]), (0.05, 0.95), axis=0)
    middle = np.round(0.5 * (low + high))
    half = np.ceil(np.clip(0.5 * (high - low) + _MARGIN_M, 0.5 * _LEAST_M, 0.5 * _MOST_M))
    for name, offset_m, colour in (("half_metres", 0.5, GRID_FINE), ("metres", 0.0, GRID)):
        lines = grid_lines(middle - half, middle + half, offset_m)
        scene.add_line_segments(
            f"{WORLD}/floor/{name}", lines.astype(np.float32), rgb(colour), thickness=_LINE_PX, thickness_units="screen"
        )


def grid_lines(low: Array, high: Array, offset_m: float = 0.0) -> Array:
    """(L, 2, 3) lines of the floor a metre apart between corners (2,), (2,), the first so far from the lower [m]."""
    x, y = (np.arange(start + offset_m, end + 1e-6) for start, end in zip(low, high, strict=True))
    return np.array(
        [
            *([[at, low[1], 0.0], [at, high[1], 0.0]] for at in x),
            *([[low[0], at, 0.0], [high[0], at, 0.0]] for at in y),
        ]
    )


FIELD_OF_VIEW = float(np.radians(40.0))
"""Of the browser's camera, from bottom to top [rad]."""

_TURN = np.radians(40.0)  # from the front towards the body's left: limbs of both sides stay apart
_ELEVATION = np.radians(12.0)
_FILLED = 0.8  # share of the window's height that the body takes
_SMALLEST_BODY_M = 0.5  # of a body of few segments


@dataclass(frozen=True, eq=False)
class OpeningView:
    """A camera whose up is z: half from the front, half from the body's left, a little from above.

    Attributes:
        position: (3,) in the scene [m].
        look_at: (3,) what is in the middle of the window [m].
    """

    position: Array
    look_at: Array

    @classmethod
    def of_body(cls, scene_T_root: Array, points_scene: Array) -> "OpeningView":
        """The viewpoint of a body.

        Args:
            scene_T_root: (4, 4) pose of its root, whose x is forward [m].
            points_scene: (N, 3) what is to be in view [m].
        """
        low, high = points_scene.min(axis=0), points_scene.max(axis=0)
        size = max(float((high - low).max()), _SMALLEST_BODY_M)
        distance = size / _FILLED / (2.0 * np.tan(FIELD_OF_VIEW / 2.0))
        azimuth = np.arctan2(scene_T_root[1, 0], scene_T_root[0, 0]) + _TURN
        level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        away = np.cos(_ELEVATION) * level + np.sin(_ELEVATION) * np.array([0.0, 0.0, 1.0])
        centre = (low + high) / 2.0
        return cls(centre + distance * away, centre)


def points_to_see(body: BodyModel, world_T_segment: Array) -> Array:
    """(N, 3) ends of bones, and cameras, of a body at poses (S, 4, 4) [m]."""
    limbs = body_bones(body, world_T_segment)
    cameras = [mounted_camera(body, world_T_segment, camera)[:3, 3] for camera in body.mounts]
    return np.concatenate([*(end for limb in limbs for end in (limb.start, limb.end)), np.reshape(cameras, (-1, 3))])
