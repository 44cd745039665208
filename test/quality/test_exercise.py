"""The N-pose and the exercise of joints, by poses of cameras that are made up."""

from collections.abc import Callable

import numpy as np

from bodycam_ros.calibration.rig import Rig
from bodycam_ros.geometry import exp_so3, rigid
from bodycam_ros.quality.place_checks import OPENING_S, check_exercise, check_registration, check_rest
from bodycam_ros.quality.sampled_recording import RegisteredSamples
from bodycam_ros.results.verdict import Finding, Level

RIG = Rig(
    cameras={"waist": "pelvis", "thigh": "thigh_left", "shin": "shin_left"},
    parents={"pelvis": None, "thigh_left": "pelvis", "shin_left": "thigh_left"},
)
SECONDS = np.concatenate([OPENING_S, np.linspace(2.0, 10.0, 20)])


def moved(thigh: Callable[[float], np.ndarray], shin: Callable[[float], np.ndarray]) -> RegisteredSamples:
    """The waist turns; the others turn on it by rotation vectors [rad] as functions of a phase 0 to 1."""
    poses: dict[str, dict[int, np.ndarray | None]] = {"waist": {}, "thigh": {}, "shin": {}}
    for number, second in enumerate(SECONDS):
        phase = max(0.0, second - 2.0) / 8.0
        waist = exp_so3(np.array([0.0, 0.0, 0.5 * phase]))
        hip = waist @ exp_so3(thigh(phase))
        knee = hip @ exp_so3(shin(phase))
        for name, rotation in (("waist", waist), ("thigh", hip), ("shin", knee)):
            poses[name][number] = rigid(rotation, np.array([0.0, 0.1 * phase, 1.0]))
    return RegisteredSamples(SECONDS, poses)


def swing(phase: float) -> np.ndarray:
    return np.array([0.7 * np.sin(12.0 * phase), 0.4 * np.sin(17.0 * phase), 0.0])


def bend(phase: float) -> np.ndarray:
    return np.array([0.0, 0.8 * np.sin(9.0 * phase), 0.0])


def levels(findings: list[Finding]) -> dict[str, Level]:
    return {finding.subject: finding.level for finding in findings if finding.level}


def test_a_joint_that_was_moved_is_good_and_a_knee_needs_one_axis() -> None:
    assert levels(list(check_exercise(moved(swing, bend), RIG))) == {}


def test_a_joint_that_was_not_moved_is_wrong_and_says_what_to_do() -> None:
    found = list(check_exercise(moved(swing, lambda phase: np.zeros(3)), RIG))
    assert levels(found) == {"knee_left": Level.WRONG}
    assert "bend and stretch the knee" in next(f.text for f in found if f.level)


def test_a_hip_that_turned_about_one_axis_only_is_doubtful() -> None:
    assert levels(list(check_exercise(moved(bend, bend), RIG))) == {"hip_left": Level.DOUBTFUL}


def test_a_joint_that_nobody_saw_is_doubtful() -> None:
    registered = moved(swing, bend)
    blind = dict.fromkeys(registered.poses["shin"])
    found = check_exercise(RegisteredSamples(SECONDS, {**registered.poses, "shin": blind}), RIG)
    assert levels(list(found)) == {"knee_left": Level.DOUBTFUL}


def test_the_n_pose_may_be_held_later() -> None:
    registered = moved(swing, bend)
    assert levels(list(check_rest(registered, RIG.cameras))) == {}
    kicked = {**registered.poses["shin"], 2: rigid(exp_so3(np.array([0.3, 0.0, 0.0])), np.zeros(3))}
    found = check_rest(RegisteredSamples(SECONDS, {**registered.poses, "shin": kicked}), RIG.cameras)
    (finding,) = found
    assert finding.level is Level.GOOD and "searches the recording" in finding.what


def test_nobody_seen_at_first_is_no_fault() -> None:
    blind = RegisteredSamples(SECONDS, {"waist": dict.fromkeys(range(len(SECONDS)))})
    (finding,) = check_rest(blind, ["waist"])
    assert finding.level is Level.GOOD and "no camera is registered" in finding.what


def test_the_share_that_finds_itself_is_judged_by_camera() -> None:
    registered = moved(swing, bend)
    few = {number: pose if number < 3 else None for number, pose in registered.poses["shin"].items()}
    half = {number: pose if number < 12 else None for number, pose in registered.poses["thigh"].items()}
    poses = {**registered.poses, "shin": few, "thigh": half}
    found = list(check_registration(RegisteredSamples(SECONDS, poses)))
    assert levels(found) == {"shin": Level.WRONG, "thigh": Level.DOUBTFUL}


def test_a_wrong_map_is_said_once() -> None:
    lost = RegisteredSamples(SECONDS, {name: dict.fromkeys(range(4)) for name in ("waist", "thigh")})
    found = list(check_registration(lost))
    assert len(found) == 1 and found[0].level is Level.WRONG and "photograph more" in found[0].text
