"""A rider and a bicycle from the first instant to the last: placed, let go, taken hold of again, live and offline."""

from dataclasses import replace
from functools import cache

import gtsam
import numpy as np
import pytest
from helpers.athlete_frames import Sight, Solved, solved
from helpers.athletes import BODY, CRANK_M, GRIP, Athlete, bicycle, cyclist, person

from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.estimation.attachments import CONFIRM_FRAMES, CouplingSettings
from bodycam_ros.estimation.coordinates import Chart, Coordinates
from bodycam_ros.estimation.coupling import Coupling
from bodycam_ros.estimation.estimator_settings import EstimatorSettings
from bodycam_ros.estimation.factors.factor import state_key
from bodycam_ros.estimation.factors.joint_rotations import SLIDES_M
from bodycam_ros.estimation.factors.motion import MotionModel
from bodycam_ros.estimation.motion_settings import MotionSettings
from bodycam_ros.estimation.whole_recording import first_initial
from bodycam_ros.estimation.window import Window
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.tangent import TreeTangent

CADENCE_RPM = 100.0
THREE_TURNS_S = 3.0 * 60.0 / CADENCE_RPM
OFF_S, ON_S = 0.6, 1.1
"""From then to then the left foot is not on its pedal."""

LEFT_LEG = [BODY.segment_index[f"{segment}_left"] for segment in ("thigh", "shin", "foot")]
DELAYS = pytest.mark.parametrize("delay", [4, "offline"])


def kicker() -> Athlete:
    """The left foot swings out from its pedal and back."""
    rides = cyclist(ON_S + 0.4, CADENCE_RPM)
    at = {name: rides.poses[:, row] for name, row in BODY.segment_index.items()}
    away = np.clip((rides.times - OFF_S) / (ON_S - OFF_S), 0.0, 1.0)
    aside = 0.15 * np.sin(np.pi * away) ** 0.5
    feet = {side: at[f"foot_{side}"].copy() for side in ("left", "right")}
    feet["left"][:, :3, 3] += aside[:, None] * (at["pelvis"][:, :3, 1] + [0.0, 0.0, 0.3])
    hands = {side: at[f"forearm_{side}"][:, :3, :3] @ GRIP + at[f"forearm_{side}"][:, :3, 3] for side in feet}
    return replace(rides, poses=person(at["pelvis"], at["torso"][:, :3, :3], feet, hands))


def unmeasured() -> Equipment:
    """Cranks that are said to be 20 mm shorter, and a right pedal that is said to be 15 mm farther out."""
    bike, joints = bicycle(), []
    unknown = {"spindle_left": np.array([0.03, 0.0, 0.0]), "spindle_right": np.array([0.03, 0.02, 0.0])}
    for joint in bike.joints:
        place = joint.parent_T_joint.copy()
        if joint.name in unknown:
            place[0, 3] *= (CRANK_M - 0.02) / CRANK_M
            place[1, 3] -= 0.015 * (joint.name == "spindle_right")
        joints.append(replace(joint, parent_T_joint=place))
    return replace(bike, joints=tuple(joints), unknown=unknown)


def described(what: str) -> Equipment | None:
    """The bicycle as somebody describes it."""
    bike = bicycle()
    held = {a.name: a for a in bike.attachments}
    bars = {name: a for name, a in held.items() if name.startswith("on_bar")}
    if what == "nothing":
        return None
    if what == "unmeasured":
        return unmeasured()
    if what == "told":
        on = ((0.0, OFF_S - 0.02), (ON_S + 0.02, np.inf))
        held["on_pedal_left"] = replace(held["on_pedal_left"], detected=False, intervals=on)
    if what == "bar away":
        held |= {name: replace(a, on_equipment=a.on_equipment + [3.0, 0.0, 0.0]) for name, a in bars.items()}
    if what == "no bar":
        held = {name: a for name, a in held.items() if name not in bars}
    return replace(bike, attachments=tuple(held.values()))


@cache
def run(who: str, what: str, delay: int | str) -> Solved:
    """Solved live, but for what is offline."""
    seconds = {"rider": 0.7, "learner": THREE_TURNS_S + 0.1}
    athlete = kicker() if who == "kicker" else cyclist(seconds[who], CADENCE_RPM)
    settings = EstimatorSettings(output_delay=delay)
    return solved(athlete, Sight(), described(what), settings=settings, live=not settings.whole_recording)


@DELAYS
def test_it_is_placed_at_the_first_instant(delay: int | str) -> None:
    first = run("rider", "no bar", delay)
    assert all(report.placed for report in first.reports)
    for name in ("on_pedal_left", "on_pedal_right", "saddle"):
        assert first.engaged(name).all()
        assert first.deviations(name)[0] < 0.005
    crank = list(bicycle().segments).index("crank")
    off = (first.equipment_poses - first.athlete.equipment_poses)[0, crank, :3, 3]
    assert np.linalg.norm(off) < 0.01


@DELAYS
def test_radius_offset_and_centre_are_known_after_three_turns(delay: int | str) -> None:
    done = run("learner", "unmeasured", delay)
    assert done.lengths.keys() == {"spindle_left_x", "spindle_right_x", "spindle_right_y"}
    for name, truth in {"spindle_left_x": CRANK_M, "spindle_right_x": -CRANK_M, "spindle_right_y": -0.125}.items():
        value, sigma = done.lengths[name]
        assert abs(value - truth) < min(0.003, 4.0 * sigma), name
    crank = list(bicycle().segments).index("crank")
    off = (done.equipment_poses - done.athlete.equipment_poses)[-1, crank, :3, 3]
    assert np.linalg.norm(off) < 0.003
    # The report says what became of it.
    begun, known = done.reports[0], done.reports[-1]
    assert begun.lengths == known.lengths == tuple(done.lengths)
    np.testing.assert_allclose(known.values, [value for value, _ in done.lengths.values()])
    assert (known.sigmas < 0.002).all()


def test_lengths_that_stay_have_a_covariance_after_minutes() -> None:
    """Nothing accelerates them, and an information without an inverse ends a recording."""
    equipment, settings = unmeasured(), MotionSettings()
    coupling = Coupling(coupled_body(BODY, equipment), equipment, CouplingSettings(), settings)
    tangent = TreeTangent(coupling.body, SLIDES_M)
    motion = MotionModel(tangent, settings)
    at = Coordinates(tangent, np.tile(np.eye(4), (1 + len(tangent.twists), 1, 1)), np.zeros(tangent.count))
    initial = first_initial(at, motion, coupling)
    chart = Chart(initial.at)
    graph = gtsam.NonlinearFactorGraph()
    window = Window(tangent.count)
    graph.add(initial.factor(state_key(0), chart))
    window.add(0, chart, graph, 0)
    prior = coupling.motion.prior(coupling.attachments.active)
    for number in range(1, 101):
        before = chart
        chart = Chart(window.at(number - 1))
        graph = gtsam.NonlinearFactorGraph()
        keys = state_key(number - 1), state_key(number)
        graph.add(motion.between(before.origin, 1.0, prior).factor(keys, (before, chart)))
        window.add(number, chart, graph, number)
    variances = np.diag(np.linalg.inv(window.square_root(100).T @ window.square_root(100)))
    assert variances.min() > 1e-14 and np.isfinite(variances).all()
    lengths = np.sqrt(variances[tangent.count + coupling._length_columns])
    np.testing.assert_allclose(lengths, 0.0, atol=1.1 * coupling._lengths.priors.max())


def leg_errors(done: Solved) -> Array:
    """(T, 3) of the left leg's joints [m], while its foot is away and a little before and after."""
    times = done.athlete.times
    errors: Array = done.position_errors[(times > OFF_S - 0.1) & (times < ON_S + 0.2)][:, LEFT_LEG]
    return errors


@DELAYS
def test_a_foot_that_leaves_its_pedal_is_let_go_and_taken_hold_of_again(delay: int | str) -> None:
    free, bound = run("kicker", "nothing", delay), run("kicker", "bicycle", delay)
    times, off = bound.athlete.times, ~bound.engaged("on_pedal_left")
    away = bound.attachment_gaps("on_pedal_left", true_equipment=True)
    frame_s, settings = times[1], CouplingSettings()
    too_far = np.flatnonzero(away > settings.release_distance)
    late_s = (CONFIRM_FRAMES + 1) * frame_s
    assert times[too_far[0]] <= times[off][0] <= times[too_far[0]] + late_s
    assert times[too_far[-1]] <= times[off][-1] <= times[too_far[-1]] + late_s
    assert off[np.flatnonzero(off)[0] : np.flatnonzero(off)[-1]].all(), "once"
    for name in ("on_pedal_right", "on_bar_left", "on_bar_right", "saddle"):
        assert bound.engaged(name).all()
    assert leg_errors(bound).mean() < leg_errors(free).mean() + 1e-4
    assert leg_errors(bound).max() < leg_errors(free).max() + 5e-4
    assert bound.position_errors.mean() < free.position_errors.mean() + 1e-4


@DELAYS
def test_a_bar_three_metres_away_is_named_and_bends_nobody(delay: int | str) -> None:
    away, without = run("rider", "bar away", delay), run("rider", "no bar", delay)
    for name in ("on_bar_left", "on_bar_right"):
        assert not away.engaged(name).any()
        np.testing.assert_allclose(away.deviations(name), 3.0, atol=0.05)
    for name in ("on_pedal_left", "on_pedal_right", "saddle"):
        assert away.engaged(name).all()
        assert away.deviations(name).max() < 0.01
    assert np.linalg.norm((away.poses - without.poses)[..., :3, 3], axis=-1).max() < 1e-4


def test_live_it_is_known_at_once_and_later_better() -> None:
    now, after, whole = (run("rider", "no bar", delay).position_errors.mean() for delay in (0, 4, "offline"))
    assert after < now < 0.0015 and whole < 1.01 * after


@pytest.mark.parametrize("delay", [4, "offline"])
def test_equipment_that_nobody_holds_is_no_reason_to_stop(delay: int | str) -> None:
    """Nothing ties it to the body, for longer than its covariance once bore."""
    never = tuple(replace(a, intervals=((1e6, 2e6),)) for a in bicycle().attachments)
    rider = cyclist(3.0, CADENCE_RPM)
    done = solved(rider, Sight(), replace(bicycle(), attachments=never), settings=EstimatorSettings(output_delay=delay))
    assert not any(report.placed for report in done.reports)
    without = solved(rider, Sight(), settings=EstimatorSettings(output_delay=delay))
    np.testing.assert_allclose(done.poses, without.poses, rtol=0.0, atol=1e-4)
