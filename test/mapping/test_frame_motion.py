"""How frames move and how sharp they are, on views of a texture whose camera turns as we say."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray
from turned_view import CAMERA
from turned_view import turned_view as view

from bodycam_ros.errors import RecordingError
from bodycam_ros.mapping.frame_motion import FrameMotion, frame_motion
from bodycam_ros.mapping.moving_camera import Frame

CUT_DEG = 10.0


@dataclass(frozen=True)
class Still:
    """A frame that is there already; None: damaged."""

    seconds: float
    pixels: NDArray[np.uint8] | None

    def grey(self) -> NDArray[np.uint8]:
        if self.pixels is None:
            raise RecordingError("torn")
        return self.pixels

    def file(self) -> tuple[str, bytes]:
        return ".png", cv2.imencode(".png", self.grey())[1].tobytes()


class Stills:
    """A moving camera of such frames."""

    name, camera = "walk.mp4", CAMERA

    def __init__(
        self, pictures: Sequence[NDArray[np.uint8] | None], readout_s: tuple[float, float] = (0.0, 0.0)
    ) -> None:
        self.readout_s = readout_s
        self._frames = [Still(row / 30.0, picture) for row, picture in enumerate(pictures)]
        self.count = len(pictures)

    @contextmanager
    def frames(self) -> Iterator[Iterator[Frame]]:
        yield iter(self._frames)


def measured(pictures: Sequence[NDArray[np.uint8] | None], readout_s: tuple[float, float] = (0.0, 0.0)) -> FrameMotion:
    told = []
    motion = frame_motion(Stills(pictures, readout_s), CUT_DEG, lambda: told.append(True))
    assert len(told) == len(pictures) == len(motion.seconds) == len(motion.sharpness) == len(motion.path_deg)
    return motion


def test_how_fast_the_camera_turns_is_known_where_rows_are_read_out_one_by_one() -> None:
    pictures = [view(1.5 * number, -0.5 * number) for number in range(6)]
    assert not measured(pictures).angular_velocity.any()
    found = np.degrees(measured(pictures, readout_s=(0.0, 0.01)).angular_velocity)
    assert found == pytest.approx(np.tile([-15.0, 45.0, 0.0], (6, 1)), abs=2.0)  # it rolls a little, too
    # A frame that is damaged makes those beside it no faster.
    torn = np.degrees(measured([*pictures[:3], None, *pictures[4:]], readout_s=(0.0, 0.01)).angular_velocity)
    assert np.delete(torn, 3, axis=0) == pytest.approx(np.delete(found, 3, axis=0), abs=2.0)
