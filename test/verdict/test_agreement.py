"""What the log keeps, and for how long."""

import numpy as np
from known_motion import BODY, RATE_HZ, START_NS, KnownMotion, segment_poses

from bodycam_ros.verdict.agreement import AgreementLog
from bodycam_ros.verdict.judge import judge
from bodycam_ros.verdict.verdict import Level, VerdictSettings

FRAME_NS = round(1e9 / RATE_HZ)
STILL = segment_poses(0.0)


def feed(log: AgreementLog, frames: range, start_ns: int = START_NS, camera: str = "head") -> None:
    """A person who stands still: one camera, a body at every image."""
    mount = BODY.mounts[camera]
    pose = STILL[BODY.segment_index[mount.segment]] @ mount.segment_T_camera
    for frame in frames:
        log.add_pose(camera, start_ns + frame * FRAME_NS, pose)
        log.add_state(start_ns + (frame - 2) * FRAME_NS, STILL)


def new_log(span_s: float = np.inf) -> AgreementLog:
    return AgreementLog(BODY, {}, VerdictSettings(), inlier_px=2.5, span_s=span_s)


def test_instants_are_looked_at_at_the_rate_that_is_set() -> None:
    log = new_log()
    feed(log, range(0, 90))
    seconds = log.agreement().seconds
    assert 29 <= len(seconds) <= 31
    np.testing.assert_allclose(np.diff(seconds), 0.1, atol=1e-6)


def test_a_long_recording_is_kept_ever_coarser() -> None:
    log = new_log()
    feed(log, range(0, 40_000, 3))
    seconds = log.agreement().seconds
    assert 1500 <= len(seconds) <= 3001
    assert seconds[0] < 0.2 and seconds[-1] > 1332.0
    assert np.diff(seconds).max() < 1.1


def test_a_live_log_forgets_what_is_older_than_its_span() -> None:
    log = new_log(span_s=2.0)
    feed(log, range(0, 300))
    seconds = log.agreement().seconds
    assert seconds[-1] - seconds[0] <= 2.0
    assert seconds[0] > 7.0


def test_time_that_jumps_back_begins_anew() -> None:
    log = new_log()
    feed(log, range(0, 90))
    feed(log, range(0, 30), START_NS - 10**12)
    agreement = log.agreement()
    assert agreement.start_ns == START_NS - 10**12
    assert agreement.seconds.max() < 1.0
    assert (np.diff(agreement.seconds) > 0.0).all()


def test_a_camera_is_known_between_two_images_and_not_across_a_pause() -> None:
    log = new_log()
    motion = KnownMotion(("head",)).log().agreement()
    assert np.isfinite(motion.world_T_registered).all()
    np.testing.assert_allclose(motion.registered("head"), motion.solved("head"), atol=0.03)
    feed(log, range(0, 30))
    feed(log, range(60, 90))
    known = np.isfinite(log.agreement().registered("head")[:, 0, 0])
    assert known.any() and not known.all()


def test_cameras_that_the_body_does_not_carry_are_not_heard() -> None:
    log = new_log()
    log.add_pose("drone", START_NS, np.eye(4))
    assert log.agreement().cameras == ()
    assert judge(log.agreement(), BODY, VerdictSettings()).level == Level.GOOD
