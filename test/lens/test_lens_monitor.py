"""The lens of a camera that is not registered is compared with its images, once."""

from pathlib import Path

import pytest

from bodycam_ros.camera.camera_image import decode_grey
from bodycam_ros.lens.lens_check import LensMonitor
from bodycam_ros.lens.lens_fit import lens_numbers, with_lens
from bodycam_ros.recording.bag_reader import open_recording


def test_a_wrong_lens_is_found_once(sample: Path) -> None:
    with open_recording(sample / "sample/bag") as recording:
        model = recording.camera_model("shin_left")
        images = [decode_grey(image) for image in recording.images(["shin_left"])]
    lens = lens_numbers(model)
    lens[:2] *= 0.75
    monitor = LensMonitor(with_lens(model, lens))
    for _ in range(60):
        monitor.add_registration(False)
    assert monitor.is_needed
    # There and back again until the lens is judged.
    assert any(monitor.add_image(image) for _ in range(6) for image in [*images, *images[::-1]])
    assert monitor.match is not None and monitor.match.is_known
    assert monitor.match.scale == pytest.approx(1.0 / 0.75, rel=0.06)
    assert not monitor.add_image(images[0])
