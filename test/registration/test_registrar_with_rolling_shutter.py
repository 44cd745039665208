"""The registrar learns how long a moving camera's rows are read out, and registers as well as if they were not."""

import numpy as np
import pytest
from helpers.rolling_camera import START_NS, landmarks_ahead, map_of, swinging, track_frames, wide_camera

from bodycam_ros.camera import readout
from bodycam_ros.camera.readout import Readout
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.pipeline.camera_front import CameraFront
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap

CAMERA = wide_camera()
IMAGES = 90


@pytest.fixture(scope="module")
def around() -> ReferenceMap:
    random = np.random.default_rng(3)
    return map_of(landmarks_ahead(260, random), random)


def registered(
    around: ReferenceMap, true_s: float, known: Readout | None = None
) -> tuple[CameraFront, list[LandmarkMatches]]:
    registrar = CameraFront(CAMERA, around, PipelineSettings(), known)
    frames = track_frames(CAMERA, around, np.random.default_rng(4), true_s, IMAGES)
    with pytest.MonkeyPatch.context() as patch:
        # Every image has errors of its own here, so that each counts in full.
        patch.setattr(readout, "_IMAGES_ALIKE", 1.0)
        return registrar, [registrar.register(frame) for frame in frames]


def error_m(matches: list[LandmarkMatches]) -> float:
    """Error of the position, rms over the second half."""
    errors = []
    for one in matches[len(matches) // 2 :]:
        assert one.world_T_camera is not None
        truth = swinging(np.array(1e-9 * (one.stamp_ns - START_NS)))
        errors.append(np.linalg.norm(log_se3(inverse(truth) @ one.world_T_camera)[3:]))
    return float(np.sqrt(np.mean(np.square(errors))))


@pytest.mark.parametrize("true_s", [0.012, -0.012, 0.0])
def test_the_readout_time_is_found(around: ReferenceMap, true_s: float) -> None:
    registrar, matches = registered(around, true_s)
    assert registrar.known.registered.readout.seconds == pytest.approx(true_s, abs=3e-4)
    assert abs(registrar.known.registered.readout.seconds - true_s) < 4.0 * registrar.known.registered.readout.sigma
    assert matches[-1].readout == registrar.known.registered.readout
    ideal = error_m(registered(around, 0.0, Readout(0.0, 0.0))[1])
    assert error_m(matches) < 1.5 * ideal + 2e-4
    if true_s == 0.0:
        assert matches[-1].shifts is None
    else:
        ignored = error_m(registered(around, true_s, Readout(0.0, 0.0))[1])
        assert ignored > 2.0 * error_m(matches)


def test_what_is_given_is_used_from_the_first_image_and_never_changed(around: ReferenceMap) -> None:
    registrar, matches = registered(around, 0.012, Readout(0.0115, 0.0))
    assert registrar.known.registered.readout.seconds == 0.0115
    assert {one.readout for one in matches} == {Readout(0.0115, 0.0)}
    assert matches[2].shifts is not None and np.abs(matches[2].shifts).max() > 0.3
