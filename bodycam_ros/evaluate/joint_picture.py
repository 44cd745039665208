"""How far each joint is off over time: positions and angles (A figure 7)."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from bodycam_ros.calibration.anthropometry import JOINT_ABOVE
from bodycam_ros.evaluate.anatomical_angles import kind_and_side
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.geometry import Array
from bodycam_ros.picture_style import (
    CENTRE,
    LEFT,
    RIGHT,
    light_grid,
    open_picture,
    panel_title,
    side_colour,
)

_ROWS = (("spine", "neck", "shoulder", "elbow"), ("hip", "knee", "ankle", "pelvis"))
_WIDTH, _ROW_HEIGHT = 16.0, 2.4  # [in]

Errors = Mapping[str, Array]
"""Segment below a joint -> (T,) error."""


def joint_errors(evaluation: Evaluation) -> tuple[Errors, Errors]:
    """Position [cm] and rotation [deg] errors of joints, against the truth or another system; empty without either.

    Rotations are geodesic against a truth, angles since the first frame (A figure 7a) against another system.
    """
    if (comparison := evaluation.comparison) is not None:
        columns = zip(comparison.segments, 100.0 * comparison.position_errors.T, strict=True)
        turns = {segment: np.degrees(joint.rotation_errors) for segment, joint in comparison.joints.items()}
        return dict(columns), turns
    if (agreement := evaluation.agreement) is not None:
        positions = {point.link: 100.0 * point.errors for point in reversed(agreement.joints)}
        return positions, {segment: np.degrees(errors) for segment, errors in agreement.angle_errors.items()}
    return {}, {}


def draw_joint_errors(evaluation: Evaluation, path: Path) -> None:
    """Write the picture as PNG: a panel for each kind of joint, left and right in their colours.

    Raises:
        OSError: the file cannot be written.
    """
    of = evaluation.comparison or evaluation.agreement
    assert of is not None
    positions, turns = joint_errors(evaluation)
    rows = [(errors, unit, kinds) for errors, unit in ((positions, "cm"), (turns, "°")) if errors for kinds in _ROWS]
    height = _ROW_HEIGHT * len(rows) + 0.4
    with open_picture(path, _WIDTH, height) as figure:
        panels = figure.subplots(len(rows), 4, sharex=True, squeeze=False)
        for row, (errors, unit, kinds) in zip(panels, rows, strict=True):
            for axes, kind in zip(row, kinds, strict=True):
                here = {segment: e for segment, e in errors.items() if _joint_kind(segment) == kind}
                _draw_panel(axes, kind, unit, {s: evaluation.solved.curve(of.stamps_ns, e) for s, e in here.items()})
            row[0].set_ylabel("position [cm]" if unit == "cm" else "rotation [°]")
        for axes in panels[-1]:
            axes.set_xlabel("time [s]")
        sides = (("left", LEFT), ("right", RIGHT), ("trunk", CENTRE))
        figure.legend(handles=[Line2D([], [], color=c, label=name) for name, c in sides], loc="lower center", ncols=3)
        figure.align_ylabels()
        figure.subplots_adjust(
            left=0.05, right=0.985, bottom=0.75 / height, top=1.0 - 0.4 / height, wspace=0.16, hspace=0.34
        )


def _joint_kind(segment: str) -> str:
    kind = kind_and_side(segment)[0]
    return JOINT_ABOVE.get(kind, kind)


def _draw_panel(axes: Axes, kind: str, unit: str, curves: Mapping[str, tuple[Array, Array]]) -> None:
    for segment, curve in curves.items():
        axes.plot(*curve, color=side_colour(segment), linewidth=1.2)
    values = np.concatenate([np.zeros(0), *(values for _, values in curves.values())])
    known = values[np.isfinite(values)]
    if not known.size:
        axes.axis("off")
        return
    panel_title(axes, kind, f"mean {known.mean():.2f} {unit}")
    axes.set_ylim(0.0, 1.1 * float(known.max()) + 1e-6)
    light_grid(axes)
