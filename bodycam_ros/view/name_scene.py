"""What joints and cameras are called, beside them in the scene."""

from viser import LabelHandle, SceneApi

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.view.scene_nodes import segment_name

_SCALE = 0.7
_ASIDE_M = 0.03


class NameScene:
    """Draws names; they move with the segments that joints and cameras are on."""

    def __init__(self, scene: SceneApi, body: BodyModel) -> None:
        self._is_shown, self._shows_cameras = False, True
        self._joints = {
            joint.name: _label(scene, f"{segment_name(joint.parent)}/name_{joint.name}", joint.name)
            for joint in body.joints
        }
        self._cameras = {
            camera: _label(scene, f"{segment_name(mount.segment)}/camera_name_{camera}", camera)
            for camera, mount in body.mounts.items()
        }
        self.reshape(body)

    def reshape(self, body: BodyModel) -> None:
        """Put the names where a body has its joints and cameras."""
        for joint in body.joints:
            self._joints[joint.name].position = joint.parent_T_joint[:3, 3]
        for camera, mount in body.mounts.items():
            # In the pyramid, not at its tip, where a joint's name may be.
            self._cameras[camera].position = mount.segment_T_camera[:3, 3] + _ASIDE_M * mount.segment_T_camera[:3, 2]

    def show(self, visible: bool) -> None:
        """Show or hide all names."""
        self._is_shown = visible
        self._refresh()

    def show_cameras(self, visible: bool) -> None:
        """Say whether cameras are shown: hidden ones have no names."""
        self._shows_cameras = visible
        self._refresh()

    def _refresh(self) -> None:
        for label in self._joints.values():
            label.visible = self._is_shown
        for label in self._cameras.values():
            label.visible = self._is_shown and self._shows_cameras


def _label(scene: SceneApi, name: str, text: str) -> LabelHandle:
    words = text.replace("_", " ")
    return scene.add_label(name, words, visible=False, font_screen_scale=_SCALE, anchor="center-left")
