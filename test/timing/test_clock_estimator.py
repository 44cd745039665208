"""Clocks of cameras that were started by hand, learned from a body of which everything is known."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.range_of_motion import START_NS
from helpers.started_by_hand import (
    BODY,
    CAMERAS,
    FLOOR,
    REFERENCE,
    CameraRun,
    Recording,
    free_running,
    watched,
)

from bodycam_ros.geometry import exp_se3
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.arrivals import Arrivals
from bodycam_ros.timing.clock_estimator import ClockEstimator
from bodycam_ros.timing.clock_state import ClockSettings

ONE_FRAME_S = 1.0 / 30.0


def errors_s(watch: ClockEstimator, recording: Recording, at_s: float | None = None) -> dict[str, float]:
    """Camera -> by how much its clock was misjudged near the end, as seen by the first reference [s]."""
    at_s = recording.duration_s - 0.1 if at_s is None else at_s
    return {
        camera: 1e-9 * clock.offset_ns(START_NS + round(1e9 * at_s)) - float(recording.run(camera).offset_s(at_s))
        for camera, clock in watch.clocks.items()
    }


def jumps(watch: ClockEstimator) -> list[tuple[str, int, float]]:
    return [(camera, *jump) for camera, history in watch.histories.items() for jump in history.jumps]


def test_cameras_of_one_trigger_come_out_as_zero_and_pass_untouched() -> None:
    recording = Recording()
    images = recording.images()
    watch, passed = watched(images)
    assert watch.sharing == set(CAMERAS)
    assert max(abs(error) for error in errors_s(watch, recording).values()) < 0.0003
    assert {id(image) for image in passed} == {id(image) for image in images}
    assert not jumps(watch)


@pytest.mark.parametrize("ahead_s", [0.02, -0.02, ONE_FRAME_S])
def test_a_camera_that_is_late_is_found_and_corrected_from_its_first_image_on(ahead_s: float) -> None:
    recording = Recording(runs={"forearm_left": CameraRun(ahead_s=ahead_s)})
    images = recording.images()
    watch, passed = watched(images)
    assert "forearm_left" not in watch.sharing and len(watch.sharing) == len(CAMERAS) - 1
    clock = watch.clocks["forearm_left"]
    assert abs(errors_s(watch, recording)["forearm_left"]) < max(0.001, 3.0 * clock.offset_sigma) < 0.008
    given = [image.stamp_ns for image in images if image.camera == "forearm_left"]
    corrected = [image.stamp_ns for image in passed if image.camera == "forearm_left"]
    moved_ns = np.subtract(given, corrected)
    assert len(moved_ns) == len(given)
    assert np.abs(1e-9 * moved_ns - ahead_s).max() < 0.004
    assert not jumps(watch)


def test_a_drift_of_100_ppm_is_found_over_a_minute() -> None:
    recording = Recording(duration_s=60.0, runs={"shin_left": CameraRun(drift=1e-4)})
    watch, _ = watched(recording.images())
    clock = watch.clocks["shin_left"]
    assert clock.drift == pytest.approx(1e-4, abs=5e-6 + 2.0 * clock.drift_sigma)
    assert clock.drift_sigma < 2e-5
    assert abs(errors_s(watch, recording)["shin_left"]) < 0.001
    assert all(abs(watch.clocks[camera].drift) < 5e-6 for camera in set(CAMERAS) - {"shin_left"})


@pytest.mark.parametrize("by_s", [0.05, -0.05])
@pytest.mark.parametrize("are_free", [False, True])
def test_a_clock_that_was_set_is_found_where_its_stamps_break(by_s: float, are_free: bool) -> None:
    altered = {"shin_left": CameraRun(jumps=((7.0, by_s),))}
    recording = Recording(runs=free_running(**altered) if are_free else altered)
    watch, passed = watched(recording.images())
    ((camera, stamp_ns, jump_s),) = jumps(watch)
    assert (camera, jump_s) == ("shin_left", pytest.approx(by_s, abs=0.004))
    assert abs(1e-9 * (stamp_ns - START_NS) - 7.0) < 0.1
    corrected_ns = [image.stamp_ns for image in passed if image.camera == "shin_left"]
    off_ns = np.subtract(corrected_ns, recording.times_ns("shin_left"))
    assert np.abs(off_ns).max() < 5e6


@pytest.mark.parametrize("seed", [1, 2])
def test_free_running_cameras_are_no_clocks_that_are_off(seed: int) -> None:
    random = np.random.default_rng(seed)
    runs = {camera: CameraRun(phase_s=round(random.uniform(0.0, ONE_FRAME_S), 6)) for camera in CAMERAS}
    watch, _ = watched(Recording(runs=runs, seed=seed).images())
    assert watch.sharing == set() and watch.shared is not None
    assert watch.shared.reference in {"waist_front", "waist_left", "waist_right"}
    assert watch.shared.period_ns == pytest.approx(1e9 * ONE_FRAME_S, abs=10)
    for camera, error_s in errors_s(watch, Recording(runs=runs)).items():
        assert abs(error_s) < 3.0 * watch.clocks[camera].offset_sigma + 1e-9
        assert abs(error_s) < 0.004
    assert not jumps(watch)


def test_offsets_are_as_good_as_they_say() -> None:
    """Squared errors in sigmas: the noise of these images is not correlated, as that of tracks is: a sixth of 1."""
    squared = []
    for seed in range(8):
        recording = Recording(duration_s=10.0, runs=free_running(), seed=seed)
        watch, _ = watched(recording.images())
        errors = errors_s(watch, recording)
        squared += [(errors[c] / watch.clocks[c].offset_sigma) ** 2 for c in CAMERAS if c != REFERENCE]
    assert 0.08 < np.mean(squared) < 0.42


def test_live_all_passes_at_once_and_is_corrected_by_what_is_known() -> None:
    recording = Recording(runs={"forearm_left": CameraRun(ahead_s=0.02)})
    passed = list[LandmarkMatches]()
    watch = ClockEstimator(BODY, CAMERAS, ClockSettings(), FLOOR, live=True)
    arrivals = Arrivals(CAMERAS, None, True, watch, passed.append)
    held, last_ns = [], 0
    for image in recording.images():
        passed.clear()
        arrivals.add(image)
        held.append(1 - len(passed))
        if image.camera == "forearm_left":
            last_ns = image.stamp_ns - passed[-1].stamp_ns if passed else 0
    assert sum(held) == 0 and max(np.cumsum(held)) <= 1.05 * 30 * len(CAMERAS)
    assert 1e-9 * last_ns == pytest.approx(0.02, abs=0.004)


@pytest.mark.parametrize("are_free", [False, True])
@pytest.mark.parametrize("camera", ["waist_left", "forearm_left"])
def test_a_camera_that_is_registered_in_a_wrong_place_is_no_evidence_of_its_clock(are_free: bool, camera: str) -> None:
    recording = Recording(duration_s=10.0, runs=free_running() if are_free else {})
    aside = exp_se3(np.array([0.0, 0.0, 0.0, 0.4, 0.0, 0.0]))
    images = [
        replace(image, world_T_camera=aside @ image.world_T_camera) if image.camera == camera else image
        for image in recording.images()
        if image.world_T_camera is not None
    ]
    watch, _ = watched(images)
    assert (camera in watch.sharing) == (not are_free)
    own = watch.clocks[camera]
    assert abs(own.offset) < 1e-6 and own.offset_sigma >= (0.019 if are_free else 1e-4)
    assert max(abs(error) for name, error in errors_s(watch, recording).items() if name != camera) < 0.004


def test_a_clock_that_is_off_by_a_tenth_of_a_second_is_no_wrong_place() -> None:
    recording = Recording(runs={"foot_left": CameraRun(ahead_s=0.1)})
    watch, _ = watched(recording.images(), ClockSettings(sigma=0.1))
    assert abs(errors_s(watch, recording)["foot_left"]) < 0.002
