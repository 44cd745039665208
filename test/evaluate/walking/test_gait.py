"""Figures of walking against a walk whose figures are known, and silence where nobody walks."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_gait import KnownGait

from bodycam_ros.body.body_model import sole_points
from bodycam_ros.evaluate import gait as gait_module
from bodycam_ros.evaluate.gait import FootEvents, Gait, foot_events, gait
from bodycam_ros.evaluate.gait_figures import gait_figures
from bodycam_ros.evaluate.true_motion import read_true_motion
from bodycam_ros.geometry import transform_points

STEP_S = 0.04


def measured(known: KnownGait) -> Gait | None:
    return gait(*known.poses(), STEP_S)


@pytest.mark.parametrize("heading_rad", [0.0, 2.3])
def test_strides_are_as_long_as_they_were_made(heading_rad: float) -> None:
    known = KnownGait(heading_rad=heading_rad)
    found = measured(known)
    assert found is not None
    figures = gait_figures(found)
    assert figures["stride_s"]["mean"] == pytest.approx(1.1, abs=0.01)
    assert figures["cadence_per_min"]["mean"] == pytest.approx(120.0 / 1.1, abs=1.0)
    assert figures["stride_m"]["mean"] == pytest.approx(1.3, abs=0.02)
    assert figures["step_m"]["mean"] == pytest.approx(0.65, abs=0.03)
    assert figures["step_width_cm"]["mean"] == pytest.approx(18.0, abs=0.5)
    assert figures["speed_m_s"]["mean"] == pytest.approx(1.3 / 1.1, abs=0.01)
    assert figures["stance_percent"]["mean"] == pytest.approx(100.0 * known.seen_stance(0), abs=0.5)
    both = 100.0 * (2.0 * known.seen_stance(0) - 1.0)
    assert figures["double_support_percent"]["mean"] == pytest.approx(both, abs=1.0)
    assert figures["stance_percent"]["mean"] + figures["swing_percent"]["mean"] == pytest.approx(100.0)
    assert figures["clearance_cm"]["mean"] == pytest.approx(100.0 * known.clearance_m(0), abs=0.6)
    assert figures["heel_rise_cm"]["mean"] == pytest.approx(10.0, abs=0.3)
    assert all(abs(figures[key]["symmetry_percent"]) < 3.0 for key in ("stride_s", "stride_m", "knee_range_deg"))
    assert 3 <= sum(figures["strides"].values()) <= 9


def test_a_release_that_nobody_saw_makes_no_stride_of_two(monkeypatch: pytest.MonkeyPatch) -> None:
    def without_the_third(*given: object) -> FootEvents:
        found = foot_events(*given)  # type: ignore[arg-type]
        return replace(found, releases=np.delete(found.releases, 2))

    monkeypatch.setattr(gait_module, "foot_events", without_the_third)
    found = measured(KnownGait())
    assert found is not None
    assert max(stride.duration for stride in found.strides) == pytest.approx(1.1, abs=0.05)


def test_a_limp_is_told_by_side() -> None:
    known = KnownGait(stance=(0.66, 0.54), lift_m=(0.06, 0.14))
    found = measured(known)
    assert found is not None
    figures = gait_figures(found)
    left, right = (100.0 * known.seen_stance(column) for column in (0, 1))
    stance = figures["stance_percent"]
    assert (stance["left"], stance["right"]) == pytest.approx((left, right), abs=0.7)
    assert stance["symmetry_percent"] == pytest.approx(200.0 * (left - right) / (left + right), abs=1.5)
    assert figures["clearance_cm"]["left"] < 0.6 * figures["clearance_cm"]["right"]
    assert figures["knee_range_deg"]["left"] < figures["knee_range_deg"]["right"]


@pytest.mark.parametrize(
    ("what", "known"),
    [
        ("too few strides", KnownGait(strides=2)),
        ("steps in place", KnownGait(stride_m=0.15)),
        ("a stroll of hours", KnownGait(stride_s=4.0)),
    ],
)
def test_nothing_is_said_where_nobody_walks(what: str, known: KnownGait) -> None:
    assert measured(known) is None, what


def test_feet_that_never_rest_do_not_walk() -> None:
    seconds, world, soles = KnownGait().poses()
    drift = 0.5 * seconds[:, None, None] * [1.0, 0.0, 0.0]
    assert gait(seconds, world, {side: sole + drift for side, sole in soles.items()}, STEP_S) is None


def test_a_stride_across_a_gap_does_not_count() -> None:
    seconds, world, soles = KnownGait().poses()
    kept = (seconds < 2.6) | (seconds > 2.8)
    whole = gait(seconds, world, soles, STEP_S)
    broken = gait(
        seconds[kept], {s: poses[kept] for s, poses in world.items()}, {s: of[kept] for s, of in soles.items()}, STEP_S
    )
    assert whole is not None and broken is not None
    assert len(broken.strides) < len(whole.strides)
    assert not any(stride.start_s < 2.7 < stride.end_s for stride in broken.strides)


def test_a_body_without_both_feet_has_no_gait() -> None:
    seconds, world, soles = KnownGait().poses()
    assert gait(seconds, world, {"left": soles["left"]}, STEP_S) is None
    del world["shin_right"]
    assert gait(seconds, world, soles, STEP_S) is None


def test_the_true_walk_of_a_recording_is_one(shared: Path) -> None:
    """``dev_walk``: five strides; the heel of the right foot meets the floor near 2.34, 3.36 and 4.38 s."""
    truth = read_true_motion(shared / "dev_walk")
    seconds = 1e-9 * (truth.stamps_ns - truth.stamps_ns[0])
    soles = {
        side: transform_points(truth.world_T_segment[f"foot_{side}"], sole_points(0.43)) for side in ("left", "right")
    }
    found = gait(seconds, truth.world_T_segment, soles, STEP_S)
    assert found is not None
    assert [stride.side for stride in found.strides] == ["left", "right", "left", "right", "left"]
    assert [stride.start_s for stride in found.of("right")] == pytest.approx([2.34, 3.36], abs=0.04)
    figures = gait_figures(found)
    assert figures["cadence_per_min"]["mean"] == pytest.approx(114.0, abs=2.0)
    assert figures["speed_m_s"]["mean"] == pytest.approx(1.32, abs=0.03)
    range_of_motion = read_true_motion(shared / "dev_rom")
    standing = {
        side: transform_points(range_of_motion.world_T_segment[f"foot_{side}"], sole_points(0.43))
        for side in ("left", "right")
    }
    seconds = 1e-9 * (range_of_motion.stamps_ns - range_of_motion.stamps_ns[0])
    assert gait(seconds, range_of_motion.world_T_segment, standing, STEP_S) is None
