"""What became of the images of a recording: the best of all rounds, in the recording's own time."""

import numpy as np
import pytest
from rolling_camera import START_NS, landmarks_ahead, map_of, rolling_pixels, swinging, track_frames, wide_camera

from bodycam_ros.camera.readout import Readout
from bodycam_ros.geometry import inverse, log_so3, transform_points
from bodycam_ros.growth.growth_settings import GrowthSettings
from bodycam_ros.growth.registration_record import RegistrationRecord
from bodycam_ros.registration.registrar import Registrar
from bodycam_ros.registration.rolling_shutter import steady_pixels

CAMERA = wide_camera()
READOUT_S = 0.012
LEAST = 12


def record_of(cameras: tuple[str, ...] = ("wide",)) -> RegistrationRecord:
    return RegistrationRecord(dict.fromkeys(cameras, CAMERA), GrowthSettings(), LEAST)


@pytest.mark.parametrize("given", [True, False])
def test_a_camera_with_rolling_rows_that_is_registered_backwards(given: bool) -> None:
    """Its rows are read from the bottom up then; the record says how they are read in the recording's time."""
    random = np.random.default_rng(3)
    around = map_of(landmarks_ahead(260, random), random)
    # Mirrored time: the rows come the other way, as in an image of a camera that reads them from the bottom up.
    known = Readout(-READOUT_S, 0.0) if given else None
    registrar = Registrar(CAMERA, around, readout=known)
    record, images = record_of(), 60 if given else 120
    end_ns = START_NS + 10_000_000_000
    for frame in track_frames(CAMERA, around, np.random.default_rng(4), -READOUT_S, images):
        record.add(registrar.register(frame), end_ns - frame.stamp_ns, backwards=True)
    # In order of the recording's time: the first poses are those that were registered last.
    for pose in list(record.poses("wide"))[:10]:
        mirrored_s = 1e-9 * (end_ns - pose.stamp_ns - START_NS)

        def real(seconds: np.ndarray, mirrored_s: float = mirrored_s) -> np.ndarray:
            return swinging(mirrored_s - seconds)

        assert pose.readout_time == pytest.approx(READOUT_S, abs=1e-12 if given else 1.5e-3)
        now, after = real(np.array([0.0, 1e-3]))
        np.testing.assert_allclose(pose.turning, log_so3(now[:3, :3].T @ after[:3, :3]) / 1e-3, atol=0.35)
        shown, visible = rolling_pixels(CAMERA, around.points_world, real, 0.0, READOUT_S)
        at_once, _ = CAMERA.project(transform_points(inverse(now), around.points_world))
        near = visible & (np.abs(shown - [320.0, 240.0]).max(axis=1) < 200.0)
        steady = steady_pixels(CAMERA, shown[near], pose.turning, pose.readout_time)
        rolled_px = np.median(np.linalg.norm(shown[near] - at_once[near], axis=1))
        left_px = np.median(np.linalg.norm(steady - at_once[near], axis=1))
        assert left_px < max(0.5 * rolled_px, 0.4)
