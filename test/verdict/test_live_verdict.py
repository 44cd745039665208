"""The live verdict: not at once, then now and then, and over some time after its cause."""

import numpy as np
from known_motion import BODY, KnownMotion, segment_poses

from bodycam_ros.geometry import Array, rigid
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.verdict.judge import LiveVerdict
from bodycam_ros.verdict.verdict import Level, VerdictSettings

START_NS = 1_700_000_000_000_000_000


def elsewhere_for_a_second(time: float, pose: Array) -> Array:
    return pose @ rigid(np.eye(3), np.array([0.0, 0.4, 0.0])) if time < 1.0 else pose


def test_a_verdict_comes_after_the_interval_and_ends_after_the_span() -> None:
    settings = VerdictSettings(span=2.0, interval=0.5)
    live = LiveVerdict(BODY, {}, settings, PoseFitSettings())
    told: dict[float, Level] = {}
    for matches in KnownMotion(altered={"shin_left": elsewhere_for_a_second}).registrations():
        live.add_registration(matches)
        time = 1e-9 * (matches.stamp_ns - START_NS)
        if matches.camera == "waist_right":
            behind = time - 0.1
            live.add_state(round(START_NS + 1e9 * behind), segment_poses(behind))
            told[time] = live.verdict().level
    assert {level for time, level in told.items() if time < 0.5} == {Level.GOOD}
    assert {level for time, level in told.items() if 0.8 < time < 1.5} == {Level.WRONG}
    assert {level for time, level in told.items() if time > 3.7} == {Level.GOOD}


def test_time_that_begins_anew_takes_the_verdict_back() -> None:
    live = LiveVerdict(BODY, {}, VerdictSettings(interval=0.5), PoseFitSettings())
    for starts_s, altered in ((0.0, {"shin_left": lambda time, pose: None}), (-1000.0, {})):
        motion = KnownMotion(("waist_front", "shin_left"), altered=altered, starts_s=starts_s)
        for matches in motion.registrations():
            live.add_registration(matches)
            live.add_state(matches.stamp_ns, segment_poses(1e-9 * (matches.stamp_ns - START_NS) - starts_s))
        assert live.verdict().level == (Level.GOOD if starts_s else Level.DOUBTFUL)
