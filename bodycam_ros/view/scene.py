"""All that is seen: the place, the body at one instant, its cameras, and from where a browser looks at first."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from types import MappingProxyType

import numpy as np
from viser import SceneApi, SceneNodeHandle, ViserServer

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.outside.station import Station
from bodycam_ros.outside.surface import Surface
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.view.camera_picture import CameraPicture, draw_picture
from bodycam_ros.view.camera_scene import CameraScene
from bodycam_ros.view.correction import Part
from bodycam_ros.view.footage import Footage
from bodycam_ros.view.motion import Motion
from bodycam_ros.view.scene_nodes import GRID, GRID_FINE, WORLD, rgb
from bodycam_ros.view.skeleton_scene import EquipmentScene, SkeletonScene, limbs_of
from bodycam_ros.view.station_scene import StationScene
from bodycam_ros.view.surface_scene import SurfaceScene

FIELD_OF_VIEW = float(np.radians(40.0))
"""Of the browser's camera, from bottom to top [rad]."""

_TURN = np.radians(40.0)  # from the front towards the body's left: limbs of both sides stay apart
_ELEVATION = np.radians(12.0)
_FILLED = 0.72  # share of the window's height that the body takes
_SMALLEST_M = 0.5  # of a body that is hardly one

_POINT_M = 0.012
_CELL_M, _SECTION_M = 0.5, 1.0
_FADES_M = 18.0


class Scene:
    """Draws a body in its place. It is told which body and which instant each time."""

    def __init__(
        self,
        server: ViserServer,
        body: BodyModel,
        reference_map: ReferenceMap | None,
        motion: Motion,
        on_click: Callable[[Part], None],
        stations: Mapping[str, Station] = MappingProxyType({}),
        read_surfaces: Callable[[], Mapping[str, Surface]] = dict,
    ) -> None:
        self._server = server
        self._motion = motion
        # Following the body moves the world past it: a browser's own camera stays under its user's hands.
        self._world = server.scene.add_frame(WORLD, show_axes=False)
        self._landmarks = _add_map(server.scene, reference_map)
        self._skeleton = SkeletonScene(server.scene, body, on_click)
        self._equipment = EquipmentScene(server.scene, len(motion.equipment))
        self._cameras = CameraScene(server.scene, body, on_click)
        self._stations = StationScene(server.scene, stations)
        self._surface = SurfaceScene(server.scene, read_surfaces)

    def show(self, body: BodyModel, instant: int, *, follow: bool) -> None:
        """Show a body at an instant, and if it is followed, at the middle of the scene."""
        world_T_segment = self._motion.segments_at(body, instant)
        with self._server.atomic():
            if follow:
                x, y, _ = world_T_segment[body.segment_index[body.root], :3, 3]
                self._world.position = (-x, -y, 0.0)
            self._skeleton.pose(body, world_T_segment)
            self._equipment.show(self._motion.equipment_at(instant))
            for camera in self._motion.registered:
                self._cameras.show_registered(camera, self._motion.registered_at(camera, instant) is not None)

    def reshape(self, body: BodyModel) -> None:
        """Show the lengths, joints and mounts of a body."""
        with self._server.atomic():
            self._skeleton.reshape(body)
            self._cameras.remount(body)

    def select(self, body: BodyModel, part: Part | None) -> None:
        """Show which part is selected."""
        self._skeleton.select(body, part)
        self._cameras.select(part)

    def look_at_body(self, body: BodyModel, instant: int) -> None:
        """Let browsers look at the body at an instant when they open the view."""
        world_T_segment = self._motion.segments_at(body, instant)
        ends_world = np.concatenate([[limb.start[0], limb.end[0]] for limb in limbs_of(body, world_T_segment)])
        root = world_T_segment[body.segment_index[body.root]]
        opening = OpeningView.of_body(root, ends_world + np.array(self._world.position))
        camera = self._server.initial_camera
        camera.fov, camera.look_at, camera.position = FIELD_OF_VIEW, opening.look_at, opening.position

    def show_picture(
        self, body: BodyModel, instant: int, camera: str | None, footage: Footage | None
    ) -> CameraPicture | None:
        """Show what a camera saw in its pyramid, with the body drawn over it; return it, None if there is none.

        Raises:
            RecordingError: the image cannot be decoded.
        """
        picture = None if footage is None else self._picture(body, instant, footage)
        pixels, is_static = None if picture is None else picture.pixels, camera in self._stations.stations
        self._cameras.show_image(*((None, None) if is_static else (camera, pixels)))
        self._stations.show_image(*((camera, pixels) if is_static else (None, None)))
        return picture

    def world_T_camera(self, body: BodyModel, instant: int, camera: str) -> Array:
        """(4, 4) where a body has a camera at an instant, or a static one stands [m]."""
        if camera in self._stations.stations:
            return self._stations.stations[camera].world_T_camera
        mount = body.mounts[camera]
        world_T_segment = self._motion.segments_at(body, instant)[body.segment_index[mount.segment]]
        world_T_camera: Array = world_T_segment @ mount.segment_T_camera
        return world_T_camera

    def show_map(self, visible: bool) -> None:
        """Show or hide the landmarks."""
        if self._landmarks is not None:
            self._landmarks.visible = visible

    def show_surface(self, visible: bool) -> None:
        """Show or hide the body's surface.

        Raises:
            BodyError: it cannot be used.
        """
        self._surface.show(visible)

    def show_cameras(self, visible: bool) -> None:
        """Show or hide the cameras."""
        self._cameras.show(visible)
        self._stations.show(visible)

    def _picture(self, body: BodyModel, instant: int, footage: Footage) -> CameraPicture | None:
        at_ns = int(self._motion.stamps_ns[instant])
        image = footage.image_at(at_ns, self._motion.frame_ns // 2)
        if image is None:
            return None
        world_T_segment = self._motion.segments_at(body, instant)
        limbs = limbs_of(body, world_T_segment) + self._motion.equipment_at(instant)
        world_T_camera = self.world_T_camera(body, instant, footage.camera)
        contour = None
        if footage.camera in self._stations.stations:
            contour = self._stations.contour(footage.camera, body, self._surface.surfaces, world_T_segment)
        matches = footage.matches.get(image.stamp_ns)
        return draw_picture(image, footage.model, world_T_camera, limbs, matches, contour)


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
    def of_body(cls, scene_T_root: Array, ends_scene: Array) -> "OpeningView":
        """The view of a body.

        Args:
            scene_T_root: (4, 4) pose of its root, whose x is forward [m].
            ends_scene: (N, 3) ends of its bones [m].
        """
        low, high = ends_scene.min(axis=0), ends_scene.max(axis=0)
        size = max(float((high - low).max()), _SMALLEST_M)
        distance = size / _FILLED / (2.0 * np.tan(FIELD_OF_VIEW / 2.0))
        azimuth = np.arctan2(scene_T_root[1, 0], scene_T_root[0, 0]) + _TURN
        level = np.array([np.cos(azimuth), np.sin(azimuth), 0.0])
        away = np.cos(_ELEVATION) * level + np.sin(_ELEVATION) * np.array([0.0, 0.0, 1.0])
        centre = (low + high) / 2.0
        return cls(centre + distance * away, centre)


def _add_map(scene: SceneApi, reference_map: ReferenceMap | None) -> SceneNodeHandle | None:
    """Add the landmarks in their colours, and where it is known what is up, a grid on the floor.

    Returns the landmarks, to be shown or hidden; None without a map, where a board on the floor is the world.
    """
    if reference_map is None or reference_map.gravity_aligned:
        scene.add_grid(
            f"{WORLD}/floor",
            infinite_grid=True,
            cell_size=_CELL_M,
            section_size=_SECTION_M,
            cell_color=rgb(GRID_FINE),
            section_color=rgb(GRID),
            fade_distance=_FADES_M,
        )
    if reference_map is None:
        return None
    return scene.add_point_cloud(
        f"{WORLD}/landmarks",
        reference_map.points_world,
        reference_map.colours,
        point_size=_POINT_M,
        point_shape="circle",
        point_shading="flat",
        precision="float32",
    )
