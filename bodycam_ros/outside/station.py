"""A station: a static calibrated camera, and where it stands."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RecordingError
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

    def check_size(self, image: NDArray[np.uint8]) -> None:
        """Refuse an image of another size than the lens is for.

        Raises:
            RecordingError: it is.
        """
        if image.shape[:2] != (self.camera.height, self.camera.width):
            raise RecordingError(
                f"camera {self.name}: an image of {image.shape[1]}x{image.shape[0]} px; cameras.yaml says that the "
                f"lens is for {self.camera.width}x{self.camera.height}"
            )
