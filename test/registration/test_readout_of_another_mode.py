"""A read-out time that was measured elsewhere gives way to the images of a recording, and to no single one of them."""

import pytest

from bodycam_ros.body.body_yaml import body_from_yaml, yaml_text
from bodycam_ros.camera.readout import Readout, VideoMode
from bodycam_ros.registration.readout_time import ReadoutTime

GLOBAL, ROLLING = Readout(0.0, 0.00013), Readout(0.0122, 0.00015)
INFORMATION = 0.002**-2

BODY = """
name: two
root: a
segments: [a, b]
joints:
  j: {parent: a, child: b, type: ball, origin_in_parent: [0.0, 0.0, 0.4]}
cameras:
  c: {segment: b, position: [0.0, 0.0, 0.0], quaternion_xyzw: [0.0, 0.0, 0.0, 1.0],
      readout_time: 0.0122, readout_sigma: 0.00015, readout_mode: [640, 480, 240.0, 30.0]}
"""


def filtered(start: Readout, seconds: float, images: int) -> ReadoutTime:
    readout = ReadoutTime(start)
    for _ in range(images):
        if not readout.is_known:
            readout.add(seconds, INFORMATION)
    return readout


def test_images_with_rolling_rows_overrule_a_body_that_was_measured_with_a_global_shutter() -> None:
    assert filtered(GLOBAL, 0.012, 60).seconds == pytest.approx(0.012, abs=0.001)


@pytest.mark.parametrize(("start", "images"), [(ROLLING, 1), (GLOBAL, 0)])
def test_what_is_known_stays_where_images_hardly_count_against_it(start: Readout, images: int) -> None:
    assert filtered(start, 0.001, images).seconds == pytest.approx(start.seconds, abs=0.001)


@pytest.mark.parametrize(
    ("mode", "is_same"),
    [
        (VideoMode(640, 480, 240.5, 24.0), True),
        (VideoMode(640, 480, 240.0), True),
        (VideoMode(640, 480, 240.0, 60.0), False),
        (VideoMode(1280, 960, 480.0, 30.0), False),
        (VideoMode(640, 480, 300.0, 30.0), False),
    ],
)
def test_it_is_hardly_known_in_another_mode(mode: VideoMode, is_same: bool) -> None:
    mount = body_from_yaml(yaml_text(body_from_yaml(BODY))).mounts["c"]
    readout = mount.readout_in(mode)
    assert readout is not None
    assert readout.seconds == 0.0122
    assert (readout.sigma == 0.00015) == is_same
    assert is_same or readout.sigma > 0.004
