"""A camera that is carried through a place: a video, or one camera of a bag. What a map needs of it."""

from collections.abc import Iterator
from contextlib import AbstractContextManager
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel


class Frame(Protocol):
    """One picture of the camera; its pixels are made only for who asks."""

    @property
    def seconds(self) -> float:
        """When it was taken, by the camera's own clock [s]."""

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W).

        Raises:
            RecordingError: it cannot be decoded.
        """

    def file(self) -> tuple[str, bytes]:
        """Suffix (".jpg", ".png") and content of an image file with it; raises as ``grey`` does."""


class MovingCamera(Protocol):
    """Frames that can be gone through more than once, the same each time.

    Attributes:
        name: of the video or topic, for people.
        camera: its lens.
        count: about how many frames there are.
        readout_s: by how much later the right border is exposed than the left, and the lower than the upper [s]; zero
            if all rows are exposed together, or nobody knows.
    """

    name: str
    camera: CameraModel
    count: int
    readout_s: tuple[float, float]

    def frames(self) -> AbstractContextManager[Iterator[Frame]]:
        """The frames in order of time, from the first on."""
