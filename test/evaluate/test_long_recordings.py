"""The picture of a recording of a minute."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

from bodycam_ros.evaluate.evaluation import Evaluation, evaluate
from bodycam_ros.evaluate.time_panels import ANGLE_PANELS, draw_angles


@pytest.fixture(scope="module")
def short(sample_out: Path) -> Evaluation:
    return evaluate(sample_out)


def repeated(short: Evaluation, times: int) -> Evaluation:
    """The same motion several times, one after the other."""
    solved, motion = short.solved, short.solved.motion
    starts_ns = np.arange(times) * solved.frame_ns * len(solved.stamps_ns)
    longer = replace(
        motion,
        stamps_ns=(starts_ns[:, None] + motion.stamps_ns).ravel(),
        joint_angles=np.tile(motion.joint_angles, (times, 1)),
        world_T_root=np.tile(motion.world_T_root, (times, 1, 1)),
        root_covariance=np.tile(motion.root_covariance, (times, 1, 1)),
    )
    return replace(short, solved=replace(solved, motion=longer))


def ink(evaluation: Evaluation) -> float:
    """Share of the hip's panel that its lines cover, if each goes through its range once a second."""
    panels = list(Figure(figsize=(6.0, 6.0)).subplots(ANGLE_PANELS, 1))
    draw_angles(panels, evaluation)
    lines = [line for line in panels[0].lines if len(line.get_xdata()) > 1]
    duration_s = max(np.nanmax(line.get_xdata()) for line in lines)
    width_points = panels[0].get_position().width * 6.0 * 72.0
    return sum(line.get_linewidth() for line in lines) * duration_s / width_points


def test_a_minute_leaves_room_between_its_lines(short: Evaluation) -> None:
    assert ink(short) < 0.05
    assert ink(repeated(short, 30)) < 0.25
