"""Clocks by motion alone on ordinary cameras' videos, against when their images truly were taken."""

import csv
from collections.abc import Iterator
from pathlib import Path

import av
import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.camera import camera_from_yaml
from bodycam_ros.ingest.angular_speed import AngularSpeed, angular_speed
from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.motion_sync import motion_times

SEGMENTS = {"pelvis": ("waist_front", "waist_left", "waist_right"), "torso": ("torso_front", "torso_back")}


@pytest.fixture(scope="module")
def recording(shared: Path) -> Path:
    path = shared / "dev_gopro_walk"
    if not path.is_dir():
        pytest.skip("the videos with ground truth (../shared/recordings/dev_gopro_walk) are not on this machine")
    return path


@pytest.fixture(scope="module")
def speeds(recording: Path) -> dict[str, AngularSpeed]:
    return {
        camera: angular_speed(
            camera_from_yaml(recording / "mp4" / f"{camera}.yaml", camera), images(recording / "mp4" / f"{camera}.mp4")
        )
        for camera in (*SEGMENTS["pelvis"], *SEGMENTS["torso"], "thigh_left")
    }


@pytest.fixture(scope="module")
def rig(recording: Path) -> Rig:
    return Rig.from_yaml(recording / "rig.yaml")


def images(video: Path) -> Iterator[tuple[float, NDArray[np.uint8]]]:
    """Media times [s] and grey images of a file."""
    with av.open(str(video)) as container:
        for frame in container.decode(container.streams.video[0]):
            yield float(frame.time), frame.to_ndarray(format="gray")


def first_images(recording: Path) -> dict[str, float]:
    """When each camera's first image, at media time 0, truly was taken [s]."""
    with (recording / "truth" / "frames.csv").open() as file:
        return {row["camera"]: 1e-9 * int(row["true_ns"]) for row in csv.DictReader(file) if row["index"] == "0"}


def test_cameras_are_aligned_without_sound(recording: Path, speeds: dict[str, AngularSpeed], rig: Rig) -> None:
    """Measured: 0.7, 2.7 and 1.0 ms within the segments, 2 to 6 ms between them."""
    truth = first_images(recording)
    times = motion_times(speeds, rig).times
    assert set(times) == set(speeds)
    errors = {camera: clock.start_s - (truth[camera] - truth["waist_front"]) for camera, clock in times.items()}
    for cameras in SEGMENTS.values():
        assert np.ptp([errors[camera] for camera in cameras]) < 0.006
    assert max(map(abs, errors.values())) < 0.04
    assert all(abs(errors[camera]) <= 3.0 * clock.start_sigma_s for camera, clock in times.items())


def test_clocks_that_are_a_frame_off_are_refined(recording: Path, speeds: dict[str, AngularSpeed], rig: Rig) -> None:
    truth = first_images(recording)
    late = dict(zip(speeds, (0.0, 0.03, -0.02, 0.015, -0.015, 0.0), strict=True))
    start = {c: CameraTime(c, truth[c] - truth["waist_front"] + late[c], 0.0, 0.002, 1e-5, "sound") for c in speeds}
    times = motion_times(speeds, rig, start).times
    errors = {camera: clock.start_s - (truth[camera] - truth["waist_front"]) for camera, clock in times.items()}
    for cameras in SEGMENTS.values():
        assert np.ptp([errors[camera] for camera in cameras]) < 0.006
