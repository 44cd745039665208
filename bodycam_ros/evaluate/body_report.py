"""A calibrated body as one page: warnings, the N-pose, and a table of joints, bones and cameras."""

from io import BytesIO
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.stick_figure import body_bones
from bodycam_ros.calibration.anthropometry import SegmentName, mirrored
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis, JointDiagnosis
from bodycam_ros.evaluate.body_tables import report_sections, summary_line
from bodycam_ros.evaluate.page import Page, Picture, Section, render_page
from bodycam_ros.picture_style import FAINT, INK, QUIET, WARNING, open_picture, panel_title, side_colour
from bodycam_ros.whole_file import write_whole

_SIZE_INCHES = (13.0, 7.5)
_FRONT = [1, 2]
"""Axes of the N-pose (x forward, y left, z up) that are across and up on the screen."""

_LABEL_ROOM_M, _NAME_ROOM_M = 0.15, 0.5
_LABEL_STEP_M = 0.06  # between two labels of a column
_BAR_HEIGHT = 0.2
_BAR_SHADES = (1.0, 0.6, 0.35)


def write_html_report(body: BodyModel, diagnosis: CalibrationDiagnosis, path: Path) -> None:
    """Write the page, whole or not at all.

    Raises:
        OutputError: the file cannot be written.
    """
    write_whole(path, html_report(body, diagnosis))


def html_report(body: BodyModel, diagnosis: CalibrationDiagnosis) -> str:
    """The page as an HTML 5 document."""
    caption = "The N-pose from the front, and the range of each joint about its own three axes; red: see the warnings."
    picture = Section(pictures=(Picture(body_png(body, diagnosis), caption),))
    warnings = Section("Warnings", warnings=diagnosis.warnings)
    lines = [summary_line(diagnosis), *([] if diagnosis.warnings else ["No warnings."])]
    first = [warnings, picture] if diagnosis.warnings else [picture]
    return render_page(Page(f"Body {body.name}", lines, [*first, *report_sections(diagnosis)]))


def body_png(body: BodyModel, diagnosis: CalibrationDiagnosis) -> bytes:
    """The picture as a PNG file's content."""
    content = BytesIO()
    with open_picture(content, *_SIZE_INCHES) as figure:
        _draw_n_pose(figure.add_axes((0.01, 0.02, 0.66, 0.9)), body, diagnosis)
        _draw_exercise(figure.add_axes((0.76, 0.08, 0.22, 0.84)), diagnosis.joints)
    return content.getvalue()


def _draw_n_pose(axes: Axes, body: BodyModel, diagnosis: CalibrationDiagnosis) -> None:
    """Skeleton, joints, lengths of bones [cm] and cameras with their names."""
    root_T_segment = body.n_pose(np.eye(4))
    poses = dict(zip(body.segments, root_T_segment, strict=True))
    lines = body_bones(body, root_T_segment)
    for bone in lines:
        ends = np.stack([bone.start[0], bone.end[0]])[:, _FRONT]
        axes.plot(*ends.T, color=side_colour(bone.segment), linewidth=3.0, alpha=0.55, solid_capstyle="round")
    joints = {joint.name: (poses[joint.parent] @ joint.parent_T_joint)[_FRONT, 3] for joint in body.joints}
    warned = {joint.name for joint in diagnosis.joints if joint.advice}
    for name, place in joints.items():
        axes.plot(*place, "o", color=WARNING if name in warned else side_colour(name), markersize=4.5)
    for measured in diagnosis.bones:
        # Of the trunk only what is across: other lengths would hide each other; they are in the table.
        is_shown = SegmentName(measured.segment).side or mirrored(measured.start) == measured.end
        if is_shown and {measured.start, measured.end} <= set(joints):
            start, end = joints[measured.start], joints[measured.end]
            if mirrored(measured.start) == measured.end:
                axes.plot(*np.stack([start, end]).T, color=QUIET, linewidth=0.6, linestyle=(0, (4, 3)))
            upright = abs(end - start)[1] > abs(end - start)[0]
            shift = np.array([-0.035 if (start + end)[0] > 0 else 0.035, 0.0]) if upright else np.array([0.0, -0.03])
            axes.annotate(
                f"{100.0 * measured.length_m:.1f} cm", tuple(0.5 * (start + end) + shift), ha="center", va="center",
                rotation=90.0 if upright else 0.0, fontsize=8.0, color=WARNING if measured.warning else INK,
            )  # fmt: skip
    cameras = {name: (poses[mount.segment] @ mount.segment_T_camera)[_FRONT, 3] for name, mount in body.mounts.items()}
    tips = [end[0, _FRONT] for bone in lines for end in (bone.start, bone.end)]
    points = np.array([np.zeros(2), *tips, *joints.values(), *cameras.values()])
    _label_cameras(axes, cameras, {c.camera for c in diagnosis.cameras if c.warning}, float(abs(points[:, 0]).max()))
    reach = float(abs(points[:, 0]).max()) + _LABEL_ROOM_M + _NAME_ROOM_M
    axes.set_xlim(-reach, reach)
    axes.set_ylim(points[:, 1].min() - 0.08, points[:, 1].max() + 0.08)
    axes.set_aspect("equal", adjustable="box")
    axes.axis("off")
    panel_title(axes, "N-pose from the front", "its left is on the right; squares: cameras")


def _label_cameras(axes: Axes, cameras: dict[str, np.ndarray], warned: set[str], reach: float) -> None:
    """Names in two columns beside the body, in the order of height, each tied to its camera."""
    for sign in (-1.0, 1.0):
        column = sorted((n for n in cameras if (cameras[n][0] > 0.0) == (sign > 0.0)), key=lambda n: cameras[n][1])
        height = -np.inf
        for name in column:
            height = max(float(cameras[name][1]), height + _LABEL_STEP_M)
            colour = WARNING if name in warned else INK
            tie = np.array([cameras[name], [sign * (reach + _LABEL_ROOM_M), height]])
            axes.plot(*tie.T, color=WARNING if name in warned else QUIET, linewidth=0.5, alpha=0.7)
            axes.plot(*cameras[name], "s", color=colour, markersize=3.6)
            axes.annotate(
                name.replace("_", " "), tuple(tie[1]), (3.0 * sign, 0.0), textcoords="offset points",
                ha="left" if sign > 0.0 else "right", va="center", fontsize=8.5, color=colour,
            )  # fmt: skip


def _draw_exercise(axes: Axes, joints: tuple[JointDiagnosis, ...]) -> None:
    """Three bars per joint: the range about each of its principal axes, the largest on top [deg]."""
    colours = [WARNING if joint.advice else side_colour(joint.name) for joint in joints]
    for row, joint in enumerate(joints):
        for index, degrees in enumerate(np.degrees(joint.exercised_rad)):
            place = row + (index - 1) * (_BAR_HEIGHT + 0.04)
            axes.barh(place, degrees, _BAR_HEIGHT, color=colours[row], alpha=_BAR_SHADES[index])
    axes.set_ylim(len(joints) - 0.4, -0.6)
    axes.set_yticks(range(len(joints)), [joint.name.replace("_", " ") for joint in joints])
    for label, colour in zip(axes.get_yticklabels(), colours, strict=True):
        label.set_color(colour)
    axes.set_xlabel("[°] about its three axes")
    axes.grid(axis="x", color=FAINT, linewidth=0.7)
    axes.set_axisbelow(True)
    axes.tick_params(axis="y", length=0.0)
    panel_title(axes, "Exercised")
