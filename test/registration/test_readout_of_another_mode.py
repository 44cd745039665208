"""A read-out time that was measured elsewhere gives way to the images of a recording, and to no single one of them."""

import pytest

from bodycam_ros.body.body_yaml import body_from_yaml, yaml_text
from bodycam_ros.camera.readout import Readout

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


def filtered(start: Readout, seconds: float, images: int) -> Readout:
    readout = start.as_start
    for _ in range(images):
        if not readout.is_known:
            readout = readout.updated(seconds, INFORMATION)
    return readout


@pytest.mark.parametrize(("start", "seconds"), [(GLOBAL, 0.012), (ROLLING, 0.0), (ROLLING, 0.008), (ROLLING, 0.0122)])
def test_images_overrule_a_body_that_was_measured_in_another_mode(start: Readout, seconds: float) -> None:
    assert filtered(start, seconds, 60).seconds == pytest.approx(seconds, abs=0.001)


def test_before_any_image_it_is_that_of_the_body() -> None:
    assert filtered(ROLLING, 0.0, 0).in_use == 0.0122
    assert filtered(GLOBAL, 0.0, 0).in_use == 0.0


def test_what_is_given_stays() -> None:
    assert filtered(Readout(0.012, 0.0), 0.001, 60).seconds == 0.012


def test_a_file_of_an_older_version_with_its_mode_is_read() -> None:
    body = body_from_yaml(yaml_text(body_from_yaml(BODY)))
    assert body.mounts["c"].readout == Readout(0.0122, 0.00015)
    assert body.readout_starts["c"].seconds == 0.0122 and body.readout_starts["c"].sigma > 0.004
