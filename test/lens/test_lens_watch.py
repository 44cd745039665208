"""A camera that does not find itself in the map is asked for its lens, a step at each image."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.lens.lens_fit import lens_of, with_lens
from bodycam_ros.lens.lens_watch import LensWatch
from bodycam_ros.recording.bag_reader import open_recording

LOST = 60


@pytest.fixture(scope="module")
def walking(sample: Path) -> tuple[Any, list[np.ndarray]]:
    """Model and grey images of a camera that turns."""
    with open_recording(sample / "sample/bag") as recording:
        images = [decode_grey(image) for image in recording.images(["shin_left"])]
        return recording.camera_model("shin_left"), [*images, *images[::-1]]


def _judged(watch: LensWatch, images: list[np.ndarray]) -> bool:
    """Look at images there and back again until the lens is judged; whether it is."""
    return any(watch.look(image) for _ in range(6) for image in images)


@pytest.mark.parametrize("scale", [0.75])
def test_a_lost_cameras_lens_is_compared_once(walking: tuple[Any, list[np.ndarray]], scale: float) -> None:
    model, images = walking
    lens = lens_of(model)
    lens[:2] *= scale
    watch = LensWatch(with_lens(model, lens))
    for _ in range(LOST):
        watch.hear(False)
    assert watch.is_doubted and _judged(watch, images)
    assert watch.match is not None and watch.match.is_known
    assert watch.match.scale == pytest.approx(1.0 / scale, rel=0.06)
    assert not watch.look(images[0]), "it is told once"
