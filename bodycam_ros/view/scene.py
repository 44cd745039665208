"""All that is seen: the place, the body at one instant, its cameras, and from where a browser looks at first."""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from viser import SceneApi, SceneNodeHandle, ViserServer

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.outside.station import Station
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.view.camera_picture import CameraPicture, draw_picture
from bodycam_ros.view.camera_scene import CameraScene
from bodycam_ros.view.correction import Part
from bodycam_ros.view.detail import FINE, Detail
from bodycam_ros.view.floor_grid import add_floor
from bodycam_ros.view.footage import Footage
from bodycam_ros.view.motion import Motion
from bodycam_ros.view.name_scene import NameScene
from bodycam_ros.view.opening_view import FIELD_OF_VIEW, OpeningView, points_to_see
from bodycam_ros.view.other_motion import OtherMotion
from bodycam_ros.view.scene_nodes import COMPARED, WORLD
from bodycam_ros.view.seen_scene import SeenScene
from bodycam_ros.view.skeleton_scene import LineScene, SkeletonScene, limbs_of
from bodycam_ros.view.station_scene import StationScene
from bodycam_ros.view.surface_scene import SurfaceReader, SurfaceScene

_POINT_M = 0.012
_AMBIENT = 1.0


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
        read_surfaces: SurfaceReader = lambda body: {},
        other: OtherMotion | None = None,
        detail: Detail = FINE,
    ) -> None:
        self._server = server
        self._motion = motion
        # Following the body moves the world past it: a browser's own camera stays under its user's hands.
        self._world = server.scene.add_frame(WORLD, show_axes=False)
        _add_light(server.scene)
        self._landmarks = _add_map(server.scene, reference_map, detail)
        self._skeleton = SkeletonScene(server.scene, body, on_click)
        self._equipment = LineScene(server.scene, "equipment", len(motion.equipment))
        self._other = other
        self._other_lines = LineScene(server.scene, "other", len(other.lines) if other else 0, COMPARED)
        self._shows_other = True
        self._cameras = CameraScene(server.scene, body, on_click)
        self._seen = SeenScene(server.scene)
        self._stations = StationScene(server.scene, stations)
        self._surface = SurfaceScene(server.scene, read_surfaces, detail)
        self._shows_surface = False
        self._is_selected = False
        self._names = NameScene(server.scene, body)

    def show(self, body: BodyModel, instant: int, *, follow: bool) -> None:
        """Show a body at an instant, and if it is followed, at the middle of the scene."""
        world_T_segment = self._motion.segments_at(body, instant)
        with self._server.atomic():
            if follow:
                x, y, _ = world_T_segment[body.segment_index[body.root], :3, 3]
                self._world.position = (-x, -y, 0.0)
            self._skeleton.pose(body, world_T_segment)
            self._equipment.show(self._motion.equipment_at(instant))
            if self._other is not None:
                at_ns, within_ns = int(self._motion.stamps_ns[instant]), self._motion.frame_ns // 2
                lines = self._other.lines_at(at_ns, within_ns) if self._shows_other else []
                self._other_lines.show(lines)
            for camera in self._motion.registered:
                self._cameras.show_registered(camera, self._motion.registered_at(camera, instant) is not None)

    def move(self, motion: Motion) -> None:
        """Take over another motion of the same body and equipment, as a running graph tells it."""
        self._motion = motion

    def reshape(self, body: BodyModel) -> None:
        """Show the lengths, joints and mounts of a body."""
        with self._server.atomic():
            self._skeleton.reshape(body)
            self._cameras.remount(body)
            self._names.reshape(body)
            self._refresh_surface(body)

    def select(self, body: BodyModel, part: Part | None) -> None:
        """Show which part is selected."""
        self._skeleton.select(body, part)
        self._cameras.select(part)
        self._is_selected = part is not None
        self._refresh_surface(body)

    def look_at_body(self, body: BodyModel, instant: int) -> None:
        """Let browsers look at the body at an instant: when they open the view, and those that have it open."""
        world_T_segment = self._motion.segments_at(body, instant)
        surfaces = self._surface.surfaces(body) if self._shows_surface else {}
        points_world = points_to_see(body, surfaces, world_T_segment)
        root = world_T_segment[body.segment_index[body.root]]
        opening = OpeningView.of_body(root, points_world + np.array(self._world.position))
        camera = self._server.initial_camera
        camera.fov, camera.look_at, camera.position = FIELD_OF_VIEW, opening.look_at, opening.position
        for client in self._server.get_clients().values():
            with client.atomic():
                client.camera.fov = FIELD_OF_VIEW
                client.camera.position, client.camera.look_at = opening.position, opening.look_at

    def show_picture(
        self, body: BodyModel, instant: int, camera: str | None, footage: Footage | None
    ) -> CameraPicture | None:
        """Show what a camera saw in its pyramid, with the body drawn over it; return it, None if there is none.

        Raises:
            RecordingError: the image cannot be decoded.
        """
        picture = None if footage is None else self._picture(body, instant, footage)
        self._seen.show(None if picture is None else picture.landmarks_world)
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

    def show_surface(self, body: BodyModel, visible: bool) -> None:
        """Show or hide the body's surface; while a part is selected, it is out of the way.

        Raises:
            BodyError: it cannot be used.
        """
        self._shows_surface = visible
        self._refresh_surface(body)

    def show_cameras(self, visible: bool) -> None:
        """Show or hide the cameras."""
        self._cameras.show(visible)
        self._stations.show(visible)
        self._names.show_cameras(visible)

    def show_other(self, body: BodyModel, instant: int, visible: bool) -> None:
        """Show or hide the solution that is compared with."""
        self._shows_other = visible
        self.show(body, instant, follow=False)

    def show_names(self, visible: bool) -> None:
        """Show or hide what joints and cameras are called."""
        self._names.show(visible)

    def _refresh_surface(self, body: BodyModel) -> None:
        self._surface.show(body, self._shows_surface and not self._is_selected)

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
            contour = self._stations.contour(footage.camera, body, self._surface.surfaces(body), world_T_segment)
        matches = footage.matches.get(image.stamp_ns)
        return draw_picture(image, footage.model, world_T_camera, limbs, matches, contour)


def _add_light(scene: SceneApi) -> None:
    """Light without shadows and reflections, which take half of the time of a picture without a graphics card."""
    scene.configure_default_lights(cast_shadow=False)
    scene.configure_environment_map(hdri=None)
    scene.add_light_ambient(f"{WORLD}/light", intensity=_AMBIENT)


def _add_map(scene: SceneApi, reference_map: ReferenceMap | None, detail: Detail) -> SceneNodeHandle | None:
    """Add the landmarks in their colours, and where it is known what is up, a grid on the floor.

    Returns the landmarks, to be shown or hidden; None without a map, where a board on the floor is the world.
    """
    if reference_map is None or reference_map.gravity_aligned:
        add_floor(scene, np.zeros((0, 3)) if reference_map is None else reference_map.points_world)
    if reference_map is None:
        return None
    drawn = detail.chosen(len(reference_map.points_world))
    return scene.add_point_cloud(
        f"{WORLD}/landmarks",
        reference_map.points_world[drawn],
        reference_map.colours[drawn],
        point_size=_POINT_M,
        point_shape="circle",
        point_shading="flat",
        precision="float32",
    )
