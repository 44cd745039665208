"""A station: a static calibrated camera, and where it stands."""

from dataclasses import dataclass

from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array


@dataclass(frozen=True, eq=False)
class Station:
    """A camera that does not move.

    Attributes:
        name: of the camera, and of its topics.
        world_T_camera: (4, 4) its optical frame in the world [m].
        camera: its lens.
    """

    name: str
    world_T_camera: Array
    camera: CameraModel
