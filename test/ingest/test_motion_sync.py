"""Clocks aligned by motion, against the clocks that made the motion."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.turning_body import RIG, Clock, camera_speed, turning_body

from bodycam_ros.ingest.motion_sync import motion_times
from bodycam_ros.tracking.angular_speed import AngularSpeed

CLOCKS = {
    "waist": Clock(1.0),
    "hip": Clock(2.713, rate=24.0),
    "back": Clock(0.4121),
    "chest": Clock(3.337, rate=59.94),
    "thigh": Clock(0.0637),
    "shin": Clock(1.9811, rate=25.0),
}


@pytest.fixture(scope="module")
def speeds() -> dict[str, AngularSpeed]:
    omega = turning_body(45.0)
    return {name: camera_speed(name, omega[RIG.cameras[name]], clock, 38.0) for name, clock in CLOCKS.items()}


def true_start(camera: str, clocks: dict[str, Clock] = CLOCKS) -> float:
    return clocks[camera].start_s - clocks["waist"].start_s


def test_clocks_are_found_without_any_sound(speeds: dict[str, AngularSpeed]) -> None:
    found, causes = motion_times(speeds, RIG)
    assert set(found) == set(CLOCKS)
    assert not causes
    errors = {camera: clock.start_s - true_start(camera) for camera, clock in found.items()}
    for camera, error in errors.items():
        assert abs(error) < 0.06, camera
        assert abs(error) <= 3.0 * found[camera].start_sigma_s, camera


def test_clocks_are_found_without_a_rig(speeds: dict[str, AngularSpeed]) -> None:
    found, causes = motion_times(speeds)
    errors = {camera: clock.start_s - true_start(camera) for camera, clock in found.items()}
    assert set(errors) == set(CLOCKS)
    assert max(map(abs, errors.values())) < 0.08


def test_a_camera_that_saw_nothing_is_named(speeds: dict[str, AngularSpeed]) -> None:
    dark = replace(speeds["shin"], omega=np.full_like(speeds["shin"].omega, np.nan))
    found, causes = motion_times({**speeds, "shin": dark}, RIG)
    assert set(found) == set(CLOCKS) - {"shin"}
    assert "show too little of its rotation" in causes["shin"]


def test_a_camera_that_moved_otherwise_is_named(speeds: dict[str, AngularSpeed]) -> None:
    other = camera_speed("shin", turning_body(45.0, seed=7)["shin"], CLOCKS["shin"], 38.0)
    found, causes = motion_times({**speeds, "shin": other}, RIG)
    assert set(found) == set(CLOCKS) - {"shin"}
    assert "does not match" in causes["shin"]


def test_cameras_with_nothing_in_common_are_named(speeds: dict[str, AngularSpeed]) -> None:
    brief = speeds["shin"].part(speeds["shin"].media_s < 1.5)
    found, causes = motion_times({**speeds, "shin": brief}, RIG)
    assert set(found) == set(CLOCKS) - {"shin"}
    assert "does not match" in causes["shin"]


def test_a_camera_that_the_rig_does_not_know_is_named(speeds: dict[str, AngularSpeed]) -> None:
    found, causes = motion_times({**speeds, "spare": replace(speeds["shin"], camera="spare")}, RIG)
    assert set(found) == set(CLOCKS)
    assert "not among the cameras of the rig" in causes["spare"]
