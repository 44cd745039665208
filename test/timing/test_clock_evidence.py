"""The side problem of clocks: its normal equations against numbers, and what it says of a window."""

import numpy as np
from range_of_motion import START_NS
from started_by_hand import BODY, CAMERAS, FLOOR, REFERENCE, CameraRun, Recording, free_running

from bodycam_ros.body.articulation import motion_of_cameras
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import inverse, log_se3
from bodycam_ros.timing.camera_path import CameraPath
from bodycam_ros.timing.clock_evidence import CameraTrack, ClockEvidence, clock_evidence

FROM_NS, INSTANTS = START_NS + 4_000_000_000, 30
STAMPS_NS = FROM_NS + 100_000_000 * np.arange(INSTANTS, dtype=np.int64)


def tracks(recording: Recording) -> dict[str, CameraTrack]:
    images = recording.images()
    found = {}
    for camera in CAMERAS:
        own = [image for image in images if image.camera == camera]
        path = CameraPath(
            np.array([image.stamp_ns for image in own]),
            np.stack([image.world_T_camera for image in own if image.world_T_camera is not None]),
        )
        found[camera] = CameraTrack(path, np.stack([image.pose_covariance for image in own]) + FLOOR)
    return found


def evidence(recording: Recording, prior_s: float = 0.05, body: BodyModel = BODY) -> ClockEvidence:
    known = tracks(recording)
    # A camera on a cart has no path of its own here: that of another shows how little it is listened to.
    known |= {camera: known["foot_left"] for camera in body.mounts if camera not in CAMERAS}
    sigmas = np.full(len(known), prior_s)
    sigmas[CAMERAS.index(REFERENCE)] = 1e-9
    found = clock_evidence(body, known, STAMPS_NS, np.diag(1.0 / sigmas**2), np.zeros(len(known)))
    assert found is not None
    return found


def test_delay_columns_are_what_errors_change_by() -> None:
    points = [track.path.interpolate(STAMPS_NS) for track in tracks(Recording(noise=0.1)).values()]
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
        found = evidence(Recording(noise=0.02, runs=runs))
        delays = dict(zip(CAMERAS, found.delays.tolist(), strict=True))
        assert abs(delays.pop("foot_left") - 0.01) < 0.0006
        assert max(abs(delay) for delay in delays.values()) < 0.0003


def test_too_few_instants_say_nothing() -> None:
    sigmas = np.ones(len(CAMERAS))
    few = clock_evidence(BODY, tracks(Recording()), STAMPS_NS[:3], np.diag(sigmas), np.zeros(len(CAMERAS)))
    assert few is None
