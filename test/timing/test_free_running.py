"""The instants at which a body is solved, and what its cameras say of them."""

import numpy as np
from helpers.range_of_motion import START_NS, range_of_motion
from helpers.started_by_hand import BODY, CAMERAS, FLOOR, CameraRun, Recording, free_running

from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.arrivals import Arrivals
from bodycam_ros.timing.clock_estimator import ClockEstimator
from bodycam_ros.timing.clock_state import ClockSettings

DURATION_S = 8.0


def brought(images: list[LandmarkMatches]) -> list[LandmarkMatches]:
    clocks = ClockEstimator(BODY, CAMERAS, ClockSettings(), FLOOR, live=False)
    arrivals = Arrivals(CAMERAS, clocks=clocks)
    frames = [frame for image in images for frame in arrivals.add(image)] + arrivals.flush()
    assert not arrivals.late
    return [each for frame in frames for each in frame.matches.values()]


def stamps_ns(said: list[LandmarkMatches]) -> np.ndarray:
    return np.unique([each.stamp_ns for each in said])


def test_triggered_cameras_are_passed_on_untouched() -> None:
    images = Recording(DURATION_S).images()
    assert {id(each) for each in brought(images)} == {id(image) for image in images}


def test_free_running_cameras_are_all_heard_at_every_instant() -> None:
    said = brought(Recording(DURATION_S, runs=free_running()).images())
    instants = stamps_ns(said)
    assert abs(len(instants) - DURATION_S * 30.0) <= 2
    assert np.ptp(np.diff(instants)) <= 1
    counts = [sum(each.stamp_ns == stamp for each in said) for stamp in instants[2:-2].tolist()]
    assert set(counts) == {len(CAMERAS)}


def test_what_they_say_of_an_instant_is_where_they_were_then() -> None:
    said = brought(Recording(DURATION_S, runs=free_running(foot_left=CameraRun(ahead_s=0.02)), noise=0.02).images())
    instants = stamps_ns(said)
    truth = range_of_motion(BODY, DURATION_S, 1000.0)
    errors = []
    for each in said:
        if instants[2] <= each.stamp_ns <= instants[-3] and each.world_T_camera is not None:
            row = round(1e-6 * (each.stamp_ns - START_NS))
            errors.append(log_se3(inverse(truth.world_T_camera[each.camera][row]) @ each.world_T_camera))
    assert len(errors) > 0.95 * len(CAMERAS) * (len(instants) - 4)
    off = np.abs(np.array(errors))
    # Half a millisecond of rounding to the rows of the truth is in it.
    assert np.percentile(np.linalg.norm(off[:, 3:], axis=1), 95) < 0.002
    assert np.percentile(np.linalg.norm(off[:, :3], axis=1), 95) < 0.005


def test_one_late_camera_is_brought_to_the_instants_of_the_others() -> None:
    recording = Recording(DURATION_S, runs={"foot_left": CameraRun(ahead_s=0.02)})
    said = brought(recording.images())
    of_others = {each.stamp_ns for each in said if each.camera != "foot_left"}
    own = [each.stamp_ns for each in said if each.camera == "foot_left"]
    assert set(own) <= of_others and len(own) >= len(of_others) - 2
    assert of_others == {image.stamp_ns for image in recording.images() if image.camera != "foot_left"}


def test_the_beat_goes_on_without_those_who_shared_it() -> None:
    alone = CAMERAS[:4]
    runs = free_running() | {camera: CameraRun(on_s=(-1.0, 5.0)) for camera in CAMERAS[4:]}
    said = brought(Recording(12.0, runs={c: r for c, r in runs.items() if c in alone or c in CAMERAS[4:]}).images())
    late = [each for each in said if each.stamp_ns > START_NS + 7_000_000_000]
    assert len(late) > 0.9 * len(alone) * 5.0 * 30.0


def test_a_pause_of_all_body_cameras_loses_none_of_their_images_while_a_static_one_goes_on() -> None:
    paused = {camera: CameraRun(off_s=(5.0, 8.0)) for camera in CAMERAS}
    for runs in (paused, free_running(**paused)):
        images = Recording(12.0, runs=runs).images()
        static = [CameraImage("wall", START_NS + 40_000_000 * number, b"") for number in range(300)]
        clocks = ClockEstimator(BODY, CAMERAS, ClockSettings(), FLOOR, live=False)
        arrivals = Arrivals([*CAMERAS, "wall"], clocks=clocks)
        in_order = sorted([*images, *static], key=lambda message: message.stamp_ns)
        frames = [frame for message in in_order for frame in arrivals.add(message)] + arrivals.flush()
        assert arrivals.late == 0
        assert sum(len(frame.images) for frame in frames) == len(static)
        assert sum(len(frame.matches) for frame in frames) > 0.99 * len(images)
