"""Samples of a camera's inertial sensor for the bag: of a GoPro's telemetry, or of a CSV beside a file."""

from pathlib import Path

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.ingest.ingest_camera import IngestCamera
from bodycam_ros.recording.camera_video import CameraVideo

_COLUMNS = "time gx gy gz ax ay az"
_LARGEST_RAD_S, _LARGEST_M_S2 = 70.0, 2000.0  # 4,000 deg/s and 200 g; more is another unit
_LEAST_GRAVITY_M_S2 = 4.0  # median specific force; less is in g, or without gravity


def read_inertial_samples(camera: IngestCamera) -> ImuSamples | None:
    """Samples of a camera's sensor in media time; None if there is none.

    A CSV named after the file or the camera (``head.csv`` beside ``head.mp4``) comes before a GoPro's telemetry.

    Raises:
        RecordingError: they cannot be used.
    """
    path = camera.video.path
    if not isinstance(camera.video, CameraVideo):
        path = path / camera.topic_name
    for name in dict.fromkeys((path.stem, camera.topic_name)):
        if (csv := path.with_name(f"{name}.csv")).is_file():
            return _read_csv(csv)
    return camera.video.inertial_samples() if isinstance(camera.video, CameraVideo) else None


def _read_csv(path: Path) -> ImuSamples:
    """Lines ``time gx gy gz ax ay az`` [s], [rad/s], [m/s^2], by commas or blanks, under one line of names or none."""
    try:
        lines = path.read_text(encoding="utf-8-sig").replace(",", " ").replace(";", " ").splitlines()
        if lines and lines[0].strip()[:1].isalpha():
            names = lines.pop(0).lower().split()
            if names != _COLUMNS.split():
                raise RecordingError(f"{path}: expected the columns {_COLUMNS}, not {' '.join(names)}")
        rows = np.array([[float(word) for word in line.split()] for line in lines if line.strip()])
    except (OSError, ValueError) as error:
        raise RecordingError(f"{path}: is no table of numbers with the columns {_COLUMNS}: {error}") from error
    if rows.ndim != 2 or rows.shape[1] != 7 or len(rows) < 2 or not np.isfinite(rows).all():
        raise RecordingError(f"{path}: expected lines of seven numbers: {_COLUMNS}")
    if not (np.diff(rows[:, 0]) > 0.0).all():
        raise RecordingError(f"{path}: its times do not increase")
    turned, force = np.abs(rows[:, 1:4]).max(), float(np.median(np.linalg.norm(rows[:, 4:], axis=1)))
    if turned > _LARGEST_RAD_S:
        raise RecordingError(f"{path}: angular velocities up to {turned:.0f}: expected rad/s, these look like deg/s")
    if not _LEAST_GRAVITY_M_S2 < force < _LARGEST_M_S2:
        raise RecordingError(
            f"{path}: the median specific force is {force:.2f}: expected m/s^2 with gravity in it (9.8 at rest)"
        )
    return ImuSamples(np.round(1e9 * rows[:, 0]).astype(np.int64), rows[:, 1:4], rows[:, 4:])
