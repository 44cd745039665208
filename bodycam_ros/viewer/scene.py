"""All that is seen: the place, the body at one instant, its cameras, and from where a browser looks at first.

Lines and not a shaded plane: without a graphics card a plane that fills the window doubles the time of a picture.
"""

from collections.abc import Callable, Mapping
from types import MappingProxyType

import numpy as np
from numpy.typing import NDArray
from viser import PointCloudHandle, SceneApi, SceneNodeHandle, ViserServer

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.plots.overlay import GOOD
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.static_cameras.station import Station
from bodycam_ros.viewer.camera_scene import CameraPicture, CameraScene, draw_picture
from bodycam_ros.viewer.correction import Part
from bodycam_ros.viewer.footage import FINE, Detail, Footage
from bodycam_ros.viewer.opening_view import FIELD_OF_VIEW, OpeningView, points_to_see
from bodycam_ros.viewer.other_motion import OtherMotion
from bodycam_ros.viewer.scene_nodes import COMPARED, GRID, GRID_FINE, WORLD, rgb
from bodycam_ros.viewer.skeleton_scene import LineScene, SkeletonScene, StationScene, limbs_of
from bodycam_ros.viewer.surface_scene import NameScene, SurfaceReader, SurfaceScene
from bodycam_ros.viewer.timeline import Motion

_POINT_M = 0.03


class SeenScene:
    """Draws landmarks."""

    def __init__(self, scene: SceneApi) -> None:
        self._scene = scene
        self._points: PointCloudHandle | None = None

    def show(self, points_world: Array | None) -> None:
        """Show points (N, 3) [m] in place of those before, or none."""
        if points_world is None or not len(points_world):
            if self._points is not None:
                self._points.visible = False
            return
        if self._points is None:
            self._points = self._scene.add_point_cloud(
                f"{WORLD}/seen", points_world, rgb(GOOD), point_size=_POINT_M, point_shape="circle",
                point_shading="flat", precision="float32",
            )  # fmt: skip
        self._points.points = points_world.astype(np.float32)
        self._points.visible = True


_CELL_M, _SECTION_M = 0.5, 1.0
_LINE_PX = 1.0
_MARGIN_M = 2.0
_LEAST_M, _MOST_M = 10.0, 60.0
"""From edge to edge."""


def add_floor(scene: SceneApi, points_world: Array) -> None:
    """Add the floor, z = 0, beneath points (N, 3) of the place [m]; N may be 0."""
    low, high = extent(points_world)
    for step, skipped, colour in ((_CELL_M, _SECTION_M, GRID_FINE), (_SECTION_M, None, GRID)):
        scene.add_line_segments(
            f"{WORLD}/floor/every_{step:g}_m",
            grid_lines(low, high, step, skipped).astype(np.float32),
            rgb(colour),
            thickness=_LINE_PX,
            thickness_units="screen",
        )


def extent(points_world: Array) -> tuple[NDArray[np.int64], NDArray[np.int64]]:
    """Corners (2,), (2,) of a floor beneath nine tenths of the points and the origin, on whole metres [m]."""
    points_xy = np.vstack([points_world[:, :2], np.zeros((1, 2))])
    # A few landmarks, far away through a window, are not the place.
    low, high = np.quantile(points_xy, (0.05, 0.95), axis=0)
    middle = np.round(0.5 * (low + high))
    half = np.ceil(np.clip(0.5 * (high - low) + _MARGIN_M, 0.5 * _LEAST_M, 0.5 * _MOST_M))
    return (middle - half).astype(np.int64), (middle + half).astype(np.int64)


def grid_lines(low: NDArray[np.int64], high: NDArray[np.int64], step_m: float, skipped_m: float | None = None) -> Array:
    """(L, 2, 3) lines between corners (2,), (2,), every so many metres; those every ``skipped_m`` are left out [m]."""
    lines = []
    for axis in (0, 1):
        for at in np.arange(low[axis], high[axis] + 0.5 * step_m, step_m):
            if skipped_m is not None and at % skipped_m == 0.0:
                continue
            line = np.zeros((2, 3))
            line[:, axis] = at
            line[:, 1 - axis] = low[1 - axis], high[1 - axis]
            lines.append(line)
    return np.array(lines)


_MAP_POINT_M = 0.012
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
        point_size=_MAP_POINT_M,
        point_shape="circle",
        point_shading="flat",
        precision="float32",
    )
