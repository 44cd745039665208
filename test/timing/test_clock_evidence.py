"""The side problem of clocks: its normal equations against numbers, and what it says of a window."""

import numpy as np
from helpers.range_of_motion import START_NS
from helpers.started_by_hand import BODY, CAMERAS, FLOOR, REFERENCE, CameraRun, Recording, free_running

from bodycam_ros.body.articulation import motion_of_cameras
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.timing.camera_path import path_points
from bodycam_ros.timing.clock_evidence import clock_evidence

FROM_NS, INSTANTS = START_NS + 4_000_000_000, 30
STAMPS_NS = FROM_NS + 100_000_000 * np.arange(INSTANTS, dtype=np.int64)


def images_of(recording: Recording) -> dict[str, list[LandmarkMatches]]:
    images = recording.images()
    return {camera: [image for image in images if image.camera == camera] for camera in CAMERAS}


def delays(recording: Recording, prior_s: float = 0.05) -> dict[str, float]:
    """Camera -> the delay that its images show, of a clock that is known to ``prior_s``."""
    window_ns = FROM_NS, FROM_NS + 100_000_000 * INSTANTS
    evidence = clock_evidence(BODY, images_of(recording), dict.fromkeys(CAMERAS, 0.0), floor=FLOOR, window_ns=window_ns)
    assert evidence is not None
    sigmas = np.full(len(CAMERAS), prior_s)
    sigmas[CAMERAS.index(REFERENCE)] = 1e-9
    found = -np.linalg.solve(evidence.hessian + np.diag(sigmas**-2), evidence.gradient)
    return dict(zip(CAMERAS, found.tolist(), strict=True))


def test_delay_columns_are_what_errors_change_by() -> None:
    points = []
    for images in images_of(Recording(noise=0.1)).values():
        stamps_ns = np.array([image.stamp_ns for image in images])
        poses = np.stack([image.world_T_camera for image in images if image.world_T_camera is not None])
        points.append(path_points(stamps_ns, poses, STAMPS_NS, 1.0))
    poses, twists = np.stack([p.poses for p in points], axis=1), np.stack([p.twists for p in points], axis=1)
    motion = motion_of_cameras(
        BODY, CAMERAS, poses, twists, np.ones(poses.shape[:2], bool), np.zeros(len(CAMERAS), bool)
    )
    analytic = motion.delay_jacobians()
    step = 1e-6
    for column, camera in enumerate(CAMERAS):
        lasting = np.zeros(motion.lasting_count)
        lasting[motion.delay_columns.start + column] = step
        moved = [motion.moved(np.zeros((INSTANTS, motion.moving_count)), sign * lasting) for sign in (1.0, -1.0)]
        changed = log_se3(inverse(moved[1].world_T_camera()) @ moved[0].world_T_camera()) / (2.0 * step)
        np.testing.assert_allclose(analytic[..., column], changed, atol=1e-5, err_msg=camera)


def test_a_delay_is_found_however_cameras_are_phased() -> None:
    for runs in ({"foot_left": CameraRun(ahead_s=0.01)}, free_running(foot_left=CameraRun(ahead_s=0.01))):
        found = delays(Recording(noise=0.02, runs=runs))
        assert abs(found.pop("foot_left") - 0.01) < 0.0006
        assert max(abs(delay) for delay in found.values()) < 0.0003


def test_too_few_instants_say_nothing() -> None:
    window_ns = FROM_NS, FROM_NS + 300_000_000
    few = clock_evidence(BODY, images_of(Recording()), dict.fromkeys(CAMERAS, 0.0), floor=FLOOR, window_ns=window_ns)
    assert few is None
