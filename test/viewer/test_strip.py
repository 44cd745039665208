"""The strip of all cameras: each in its place, one read at a time, and one that fails stops no other."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest

from bodycam_ros.body.body_file import read_body
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.results.colours import rgb
from bodycam_ros.results.footage import Footage
from bodycam_ros.viewer.motion import Motion
from bodycam_ros.viewer.scene import LOST, UNKNOWN
from bodycam_ros.viewer.server import LocalServer
from bodycam_ros.viewer.strip import HEIGHT, WIDTH, Strip, draw_thumbnail

CAMERAS = ("head", "shin_left", "waist_front", "foot_left", "foot_right")


@pytest.fixture
def server() -> Iterator[LocalServer]:
    server = LocalServer(0, "test")
    yield server
    server.stop()


@pytest.fixture
def footage(sample: Path) -> Iterator[Footage]:
    footage = Footage(sample / "sample" / "bag", None)
    yield footage
    footage.close()


@pytest.fixture
def motion(sample: Path, footage: Footage) -> Motion:
    return replace(Motion.standing(read_body(sample / "body.yaml")), stamps_ns=footage.times_ns("head")[:1])


def strip_of(server: LocalServer, footage: Footage, motion: Motion) -> Strip:
    above = server.gui.add_panel()
    above.dock_left()
    return Strip(server, CAMERAS, footage, motion, above)


def test_every_camera_is_read_once_and_shown_small(server: LocalServer, footage: Footage, motion: Motion) -> None:
    strip = strip_of(server, footage, motion)
    assert not strip.is_due
    strip.show(0)
    reads = 0
    while strip.is_due:
        assert strip.is_begun == (reads > 0)
        strip.read_next()
        reads += 1
    assert reads == len(CAMERAS)
    picture = strip.picture
    assert picture.shape == (2 * HEIGHT, 4 * WIDTH, 3)
    image = footage.image_at("foot_right", int(motion.stamps_ns[0]), motion.frame_ns // 2)
    assert image is not None
    small = cv2.resize(decode_grey(image), (WIDTH, HEIGHT), interpolation=cv2.INTER_AREA)
    inside = slice(8, HEIGHT // 2), slice(8, WIDTH - 8)
    assert np.array_equal(picture[HEIGHT:, :WIDTH][inside], np.repeat(small[inside][..., None], 3, axis=2))
    assert tuple(picture[0, 0]) == rgb(UNKNOWN)


def test_an_image_that_cannot_be_decoded_stops_no_other(
    server: LocalServer, footage: Footage, motion: Motion, monkeypatch: pytest.MonkeyPatch
) -> None:
    read = footage.image_at

    def damaged(camera: str, at_ns: int, within_ns: int) -> CameraImage | None:
        image = read(camera, at_ns, within_ns)
        return replace(image, content=b"no image") if image is not None and camera == CAMERAS[0] else image

    monkeypatch.setattr(footage, "image_at", damaged)
    strip = strip_of(server, footage, motion)
    strip.show(0)
    while strip.is_due:
        strip.read_next()
    expected = draw_thumbnail(None, f"{CAMERAS[0]}: damaged", UNKNOWN)
    assert np.array_equal(strip.picture[:HEIGHT, :WIDTH], expected)
    inside = strip.picture[8 : HEIGHT // 2, WIDTH + 8 : 2 * WIDTH - 8]
    assert len(np.unique(inside)) > 10, "the others are shown"


def test_a_lost_camera_without_an_image_has_its_edge_and_nothing_else() -> None:
    thumbnail = draw_thumbnail(None, "", LOST)
    assert tuple(thumbnail[1, 50]) == rgb(LOST)
    assert len(np.unique(thumbnail[8:-8, 8:-8])) == 1
