"""The view of a photograph of the map: its pixels, as the file has them, and files that are none."""

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.errors import MapError
from bodycam_ros.film.shots import PhotographShots
from bodycam_ros.registration.reference_map import ReferenceMap

NAME, SIZE = "ref_0048", (640, 480)


@pytest.fixture(scope="module")
def reference_map(sample: Path) -> ReferenceMap:
    return ReferenceMap.load(sample / "map")


@pytest.mark.parametrize("content", [b"no picture", b""])
def test_a_damaged_photograph_is_named(sample: Path, reference_map: ReferenceMap, content: bytes) -> None:
    photographs = reference_map.photographs
    assert photographs is not None
    damaged = replace(photographs, jpegs=tuple(content for _ in photographs.jpegs))
    with naming(MapError, f"{NAME}.jpg"):
        PhotographShots(NAME, sample / "map", replace(reference_map, photographs=damaged), None, SIZE)


def test_a_file_s_orientation_tag_turns_nothing(sample: Path, reference_map: ReferenceMap, tmp_path: Path) -> None:
    """A calibration holds for the sensor's rows and columns, whatever way the camera was held."""
    picture = np.zeros((480, 640, 3), np.uint8)
    picture[:100, :, 2] = 255
    encoded = cv2.imencode(".jpg", picture)[1].tobytes()
    upside_down = bytes.fromhex("ffe100224578696600004d4d002a00000008000101120003000000010003000000000000")
    (tmp_path / f"{NAME}.jpg").write_bytes(encoded[:2] + upside_down + encoded[2:])
    assert cv2.imread(str(tmp_path / f"{NAME}.jpg"))[50, 320, 2] < 50, "OpenCV obeys the tag"
    shown = PhotographShots(NAME, sample / "map", reference_map, tmp_path, SIZE).background(None)
    assert shown[50, 320, 2] > 200 and shown[400, 320, 2] < 50
