"""The models of several cameras, as their camera_info arrive."""

from collections.abc import Callable, Iterable
from typing import Any

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import LensError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.images import camera_model
from bodycam_ros.nodes.quality import reliable
from bodycam_ros.nodes.stage_node import StageNode

_DEPTH = 10


class CameraModels:
    """Listens to the camera_info of some cameras; the first message of each counts.

    Args:
        node: listens.
        cameras: their names.
        on_change: called when a camera's model is known, or refused.

    Attributes:
        models: camera -> its model.
        refused: cameras whose camera_info is unusable; the others go on without them.
    """

    def __init__(self, node: StageNode[Any], cameras: Iterable[str], on_change: Callable[[str], None]) -> None:
        self._node = node
        self._on_change = on_change
        self.models: dict[str, CameraModel] = {}
        self.refused: set[str] = set()
        self._awaited = {camera: self._listen(camera) for camera in cameras}

    @property
    def missing(self) -> list[str]:
        """Cameras that were not heard of yet."""
        return [camera for camera in self._awaited if camera not in self.models and camera not in self.refused]

    def _listen(self, camera: str) -> Any:
        def on_info(message: Message) -> None:
            self._learn(camera, message)

        return self._node.subscription("sensor_msgs/msg/CameraInfo", f"{camera}/camera_info", on_info, reliable(_DEPTH))

    def _learn(self, camera: str, message: Message) -> None:
        if camera in self.models or camera in self.refused:
            return
        try:
            self.models[camera] = camera_model(message, camera)
        except LensError as error:
            self.refused.add(camera)
            self._node.get_logger().error(f"{error}; the other cameras go on without this one")
        self._on_change(camera)
