"""All that is seen in the scene: the place, the body at one instant, its cameras."""

from collections.abc import Callable

import numpy as np
from viser import ViserServer

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.view.camera_picture import CameraPicture, draw_picture
from bodycam_ros.view.camera_scene import CameraScene
from bodycam_ros.view.correction import Part
from bodycam_ros.view.footage import Footage
from bodycam_ros.view.map_scene import WORLD, add_map
from bodycam_ros.view.motion import Motion
from bodycam_ros.view.opening_view import FIELD_OF_VIEW, OpeningView
from bodycam_ros.view.skeleton_scene import SkeletonScene, limbs_of


class Stage:
    """Draws a body in its place. It is told which body and which instant each time."""

    def __init__(
        self,
        server: ViserServer,
        body: BodyModel,
        reference_map: ReferenceMap,
        motion: Motion,
        on_click: Callable[[Part], None],
    ) -> None:
        self._server = server
        self._motion = motion
        # Following the body moves the world past it: a browser's own camera stays under its user's hands.
        self._world = server.scene.add_frame(WORLD, show_axes=False)
        self._landmarks = add_map(server.scene, reference_map)
        self._skeleton = SkeletonScene(server.scene, body, on_click)
        self._cameras = CameraScene(server.scene, body, on_click)

    def show(self, body: BodyModel, instant: int, *, follow: bool) -> None:
        """Show a body at an instant, and if it is followed, at the middle of the scene."""
        world_T_segment = self._motion.segments_at(body, instant)
        with self._server.atomic():
            if follow:
                x, y, _ = world_T_segment[body.segment_index[body.root], :3, 3]
                self._world.position = (-x, -y, 0.0)
            self._skeleton.pose(body, world_T_segment)
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
        self._cameras.show_image(camera, None if picture is None else picture.pixels)
        return picture

    def world_T_camera(self, body: BodyModel, instant: int, camera: str) -> Array:
        """(4, 4) where a body has a camera at an instant [m]."""
        mount = body.mounts[camera]
        world_T_segment = self._motion.segments_at(body, instant)[body.segment_index[mount.segment]]
        world_T_camera: Array = world_T_segment @ mount.segment_T_camera
        return world_T_camera

    def show_map(self, visible: bool) -> None:
        """Show or hide the landmarks."""
        self._landmarks.visible = visible

    def show_cameras(self, visible: bool) -> None:
        """Show or hide the cameras."""
        self._cameras.show(visible)

    def _picture(self, body: BodyModel, instant: int, footage: Footage) -> CameraPicture | None:
        at_ns = int(self._motion.stamps_ns[instant])
        image = footage.image_at(at_ns, self._motion.frame_ns // 2)
        if image is None:
            return None
        limbs = limbs_of(body, self._motion.segments_at(body, instant))
        world_T_camera = self.world_T_camera(body, instant, footage.camera)
        return draw_picture(image, footage.model, world_T_camera, limbs, footage.matches.get(image.stamp_ns))
