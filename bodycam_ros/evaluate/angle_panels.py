"""Panels: angles of hips, knees, shoulders and elbows over time."""

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D

from bodycam_ros.drawing.picture_style import INK, LEFT, QUIET, RIGHT, light_grid, panel_title, side_colour
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.flexion import LIMBS, LimbJoint, flexion, limb_joints
from bodycam_ros.evaluate.time_curve import broken_at_gaps, lone_marker

PANELS = len(LIMBS)
DASHED = (0, (3, 2))


def draw_angles(panels: Sequence[Axes], evaluation: Evaluation) -> None:
    """Draw one panel per kind of joint, left and right in their colours, the truth dashed."""
    joints = limb_joints(evaluation.solved.urdf.segments)
    for axes, name in zip(panels, LIMBS, strict=True):
        for joint in (joint for joint in joints if joint.name == name):
            _draw_joint(axes, evaluation, joint)
        if any(joint.name == name for joint in joints):
            light_grid(axes)
        else:
            axes.text(
                0.5, 0.5, f"no {name} in this body", transform=axes.transAxes, ha="center", va="center", color=QUIET
            )
            axes.set_yticks([])
        axes.set_ylabel(f"{name} [°]")
        axes.margins(y=0.12)
    panel_title(panels[0], "Flexion", "forward; shoulder: in any direction")
    handles = [Line2D([], [], color=LEFT, label="left"), Line2D([], [], color=RIGHT, label="right")]
    if evaluation.comparison is not None:
        handles.append(Line2D([], [], color=INK, linewidth=1.0, linestyle=DASHED, label="truth"))
    panels[0].legend(
        handles=handles,
        loc="lower right",
        bbox_to_anchor=(1.0, 0.98),
        ncols=len(handles),
        handlelength=1.6,
        borderaxespad=0,
    )


def _draw_joint(axes: Axes, evaluation: Evaluation, joint: LimbJoint) -> None:
    solved = evaluation.solved
    parent = solved.urdf.parent_segments()[joint.segment]
    world_R_parent, world_R_child = (solved.world_T_link[segment][:, :3, :3] for segment in (parent, joint.segment))
    angle = np.degrees(flexion(joint.name, np.swapaxes(world_R_parent, 1, 2) @ world_R_child))
    curve = broken_at_gaps(solved, solved.stamps_ns, angle)
    axes.plot(*curve, color=side_colour(joint.segment), linewidth=1.6, marker=lone_marker(curve))
    if evaluation.comparison is not None and joint.segment in evaluation.comparison.joints:
        true = np.degrees(flexion(joint.name, evaluation.comparison.joints[joint.segment].true))
        axes.plot(
            *broken_at_gaps(solved, evaluation.comparison.stamps_ns, true), color=INK, linewidth=0.8, linestyle=DASHED
        )
