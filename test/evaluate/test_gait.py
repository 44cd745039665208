"""Figures of walking against a walk whose figures are known, and silence where nobody walks."""

from pathlib import Path

import numpy as np
import pytest
from helpers.known_gait import KnownGait

from bodycam_ros.body.body_model import sole_points
from bodycam_ros.evaluate.comparison import read_true_motion
from bodycam_ros.evaluate.gait import Stride, Walk, find_strides, gait_figures
from bodycam_ros.geometry import transform_points

STEP_S = 0.04


def measured(known: KnownGait) -> tuple[Stride, ...]:
    return find_strides(*known.poses(), STEP_S)


@pytest.mark.parametrize("heading_rad", [0.0, 2.3])
def test_strides_are_as_long_as_they_were_made(heading_rad: float) -> None:
    known = KnownGait(heading_rad=heading_rad)
    found = measured(known)
    assert found
    figures = gait_figures(found)
    assert figures.stride_s.mean == pytest.approx(1.1, abs=0.01)
    assert figures.cadence_per_min.mean == pytest.approx(120.0 / 1.1, abs=1.0)
    assert figures.stride_m.mean == pytest.approx(1.3, abs=0.02)
    assert figures.step_m.mean == pytest.approx(0.65, abs=0.03)
    assert figures.step_width_cm.mean == pytest.approx(18.0, abs=0.5)
    assert figures.speed_m_s.mean == pytest.approx(1.3 / 1.1, abs=0.01)
    assert figures.stance_percent.mean == pytest.approx(100.0 * known.seen_stance(0), abs=0.5)
    both = 100.0 * (2.0 * known.seen_stance(0) - 1.0)
    assert figures.double_support_percent.mean == pytest.approx(both, abs=1.0)
    assert figures.clearance_cm.mean == pytest.approx(100.0 * known.clearance_m(0), abs=0.6)
    assert all(abs(getattr(figures, key).symmetry_percent) < 3.0 for key in ("stride_s", "stride_m", "knee_range_deg"))
    assert 3 <= sum(figures.strides.values()) <= 9


def test_a_release_that_was_not_seen_makes_no_stride_of_two() -> None:
    walk = Walk(*KnownGait().poses())
    contact_s = float(walk.contacts["left"][1])
    stride = walk.stride("left", contact_s, STEP_S)
    assert stride is not None and stride.end_s - stride.start_s == pytest.approx(1.1, abs=0.05)
    walk.releases["left"] = np.delete(walk.releases["left"], np.searchsorted(walk.releases["left"], contact_s))
    assert walk.stride("left", contact_s, STEP_S) is None


def test_a_limp_is_told_by_side() -> None:
    known = KnownGait(stance=(0.66, 0.54), lift_m=(0.06, 0.14))
    found = measured(known)
    assert found
    figures = gait_figures(found)
    left, right = (100.0 * known.seen_stance(column) for column in (0, 1))
    stance = figures.stance_percent
    assert (stance.left, stance.right) == pytest.approx((left, right), abs=0.7)
    assert stance.symmetry_percent == pytest.approx(200.0 * (left - right) / (left + right), abs=1.5)
    assert figures.clearance_cm.left < 0.6 * figures.clearance_cm.right
    assert figures.knee_range_deg.left < figures.knee_range_deg.right


@pytest.mark.parametrize(
    ("what", "known"),
    [
        ("too few strides", KnownGait(strides=2)),
        ("steps in place", KnownGait(stride_m=0.15)),
        ("a stroll of hours", KnownGait(stride_s=4.0)),
    ],
)
def test_nothing_is_said_where_nobody_walks(what: str, known: KnownGait) -> None:
    assert not measured(known), what


def test_feet_that_never_rest_do_not_walk() -> None:
    seconds, world, soles = KnownGait().poses()
    drift = 0.5 * seconds[:, None, None] * [1.0, 0.0, 0.0]
    assert not find_strides(seconds, world, {side: sole + drift for side, sole in soles.items()}, STEP_S)


def test_a_stride_across_a_gap_does_not_count() -> None:
    seconds, world, soles = KnownGait().poses()
    kept = (seconds < 2.6) | (seconds > 2.8)
    whole = find_strides(seconds, world, soles, STEP_S)
    broken = find_strides(
        seconds[kept], {s: poses[kept] for s, poses in world.items()}, {s: of[kept] for s, of in soles.items()}, STEP_S
    )
    assert whole and broken
    assert len(broken) < len(whole)
    assert not any(stride.start_s < 2.7 < stride.end_s for stride in broken)


def test_a_body_without_both_feet_has_no_gait() -> None:
    seconds, world, soles = KnownGait().poses()
    assert not find_strides(seconds, world, {"left": soles["left"]}, STEP_S)
    del world["shin_right"]
    assert not find_strides(seconds, world, soles, STEP_S)


def test_the_true_walk_of_a_recording_is_one(shared: Path) -> None:
    """``dev_walk``: five strides; the heel of the right foot meets the floor near 2.34, 3.36 and 4.38 s."""
    truth = read_true_motion(shared / "dev_walk")
    seconds = 1e-9 * (truth.stamps_ns - truth.stamps_ns[0])
    soles = {
        side: transform_points(truth.world_T_segment[f"foot_{side}"], sole_points(0.43)) for side in ("left", "right")
    }
    found = find_strides(seconds, truth.world_T_segment, soles, STEP_S)
    assert found
    assert [stride.side for stride in found] == ["left", "right", "left", "right", "left"]
    assert [stride.start_s for stride in found if stride.side == "right"] == pytest.approx([2.34, 3.36], abs=0.04)
    figures = gait_figures(found)
    assert figures.cadence_per_min.mean == pytest.approx(114.0, abs=2.0)
    assert figures.speed_m_s.mean == pytest.approx(1.32, abs=0.03)
    range_of_motion = read_true_motion(shared / "dev_rom")
    standing = {
        side: transform_points(range_of_motion.world_T_segment[f"foot_{side}"], sole_points(0.43))
        for side in ("left", "right")
    }
    seconds = 1e-9 * (range_of_motion.stamps_ns - range_of_motion.stamps_ns[0])
    assert not find_strides(seconds, range_of_motion.world_T_segment, standing, STEP_S)
