"""The report of a calibrated body: sections for terminal and page, the page, and figures for the body file."""

import math
from io import BytesIO
from typing import Any

import msgspec
import numpy as np
from matplotlib.axes import Axes

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.segment_name import SegmentName, mirrored
from bodycam_ros.body.stick_figure import body_bones
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.evaluate.sections import Columns, Picture, Section, column_table, render_page
from bodycam_ros.results.colours import INK, QUIET, WARNING, side_colour
from bodycam_ros.results.picture_style import open_picture, panel_title

_SIZE_INCHES = (9.0, 7.5)
_FRONT = [1, 2]
"""Axes of the N-pose (x forward, y left, z up) that are across and up on the screen."""

_LABEL_ROOM_M, _NAME_ROOM_M = 0.15, 0.5
_LABEL_STEP_M = 0.06  # between two labels of a column
_DIGITS = 4

_MM = 1000.0
_MS = 1000.0
_DEG = math.degrees(1.0)
_JOINTS: Columns = (
    ("moves", "freedom", ""), ("exercised [deg]", "exercised_rad", ".0f", _DEG), ("gap [mm]", "gap_m", ".1f", _MM),
    ("sigma [mm]", "sigma_m", ".1f", _MM),
)  # fmt: skip
_JOINTS_NOTE = {
    "moves": "a ball joint turns about all axes, a hinge about one",
    "exercised": "range of its motion about its own three axes",
    "gap": "median distance between the joint on the segment above and on the one below",
    "sigma": "one standard deviation of its place forward, left, up",
}
_BONES: Columns = (
    ("length [mm]", "length_m", ".1f", _MM), ("sigma [mm]", "sigma_m", ".1f", _MM),
    ("other side [mm]", "mirror_m", ".1f", _MM), ("difference [mm]", "asymmetry_m", "+.1f", _MM),
    ("expected [mm]", "expected_m", ".0f", _MM),
)  # fmt: skip
_BONES_NOTE = {
    "sigma": "one standard deviation of the length",
    "difference": "this side minus the other one",
    "expected": "mean of people of this stature (de Leva 1996)",
}
_CAMERAS: Columns = (
    ("registered", "registered", ".1%"), ("gap [mm]", "residual_m", ".1f", _MM),
    ("gap [deg]", "residual_rad", ".2f", _DEG), ("moved [mm]", "moved_m", ".1f", _MM),
    ("turned [deg]", "turned_rad", ".2f", _DEG), ("slipped at [s]", "slipped_s", ".1f"),
    ("read-out [ms]", "readout.seconds", ".2f", _MS), ("clock [ms]", "clock_s", "+.1f", _MS),
)  # fmt: skip
_CAMERAS_NOTE = {
    "gap": "median distance between the registered pose of the camera and its pose by the body",
    "moved": "lasting change of its place on the segment",
    "turned": "lasting change of its direction on the segment",
    "read-out": "time from the first row to the last",
    "clock": "how far the clock of the camera is ahead of the reference's (+) or behind it (-), which is corrected",
}


def html_report(body: BodyModel, diagnosis: CalibrationDiagnosis) -> str:
    """The page as an HTML 5 document."""
    caption = "The N-pose from the front" + ("; red: see the warnings." if diagnosis.warnings else ".")
    picture = Section(pictures=(Picture(body_png(body, diagnosis), caption),))
    warnings = Section("Warnings", warnings=diagnosis.warnings)
    lines = [summary_line(diagnosis), *([] if diagnosis.warnings else ["No warnings."])]
    first = [warnings, picture] if diagnosis.warnings else [picture]
    return render_page(f"Body {body.name}", lines, [*first, *report_sections(diagnosis)])


def body_png(body: BodyModel, diagnosis: CalibrationDiagnosis) -> bytes:
    """The picture as a PNG file's content."""
    content = BytesIO()
    with open_picture(content, *_SIZE_INCHES) as figure:
        _draw_n_pose(figure.add_axes((0.01, 0.02, 0.98, 0.9)), body, diagnosis)
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
        # The trunk's other lengths would hide each other; they are in the table.
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
    panel_title(axes, "N-pose from the front", "its left is on the right of the picture; squares: cameras")


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


def report_sections(diagnosis: CalibrationDiagnosis) -> list[Section]:
    """A section with a table each, in the order in which a person should read them."""
    joints = {joint.name: joint for joint in diagnosis.joints}
    bones = {f"{SegmentName(bone.segment).words}: {bone.start} to {bone.end}": bone for bone in diagnosis.bones}
    cameras = {camera.camera: camera for camera in diagnosis.cameras}
    # Apart: a camera may be named as a joint is.
    untrained = {name for name, joint in joints.items() if joint.advice}
    odd = {name for name, bone in bones.items() if bone.warning}
    faulty = {name for name, camera in cameras.items() if camera.warning}
    return [
        column_table("joints", "joint", _JOINTS, joints, _JOINTS_NOTE, untrained),
        column_table("bones", "bone", _BONES, bones, _BONES_NOTE, odd),
        column_table("cameras", "camera", _CAMERAS, cameras, _CAMERAS_NOTE, faulty),
    ]


def summary_line(diagnosis: CalibrationDiagnosis) -> str:
    """The recording and the person in one sentence."""
    start_s, end_s = diagnosis.rest_s
    stature_m = diagnosis.stature_m
    return (
        f"{diagnosis.duration_s:.1f} s recorded; N-pose from {start_s:.1f} to {end_s:.1f} s, facing "
        f"{math.degrees(diagnosis.heading_rad):z.0f} deg from the map's x; "
        + ("too few bones for a stature" if stature_m is None else f"stature by the bones {stature_m:.2f} m")
    )


def body_report(diagnosis: CalibrationDiagnosis) -> dict[str, Any]:
    """Figures by joint, bone and camera for the body file; bones are named ``segment: start-end``."""
    figures = plain(diagnosis)
    figures["joints"] = {each.pop("name"): each for each in figures["joints"]}
    figures["bones"] = {"{segment}: {start}-{end}".format(**each): each for each in figures["bones"]}
    figures["cameras"] = {each.pop("camera"): each for each in figures["cameras"]}
    return {"source": "range of motion", "warnings": list(diagnosis.warnings), **figures}


def plain(value: Any) -> Any:
    """Dataclasses and arrays as YAML writes them: tables, lists, and numbers of four digits."""
    return _rounded(msgspec.to_builtins(value, enc_hook=lambda other: other.tolist()))


def _rounded(value: Any) -> Any:
    if isinstance(value, dict):
        return {name: _rounded(inner) for name, inner in value.items()}
    if isinstance(value, list | tuple):
        return [_rounded(inner) for inner in value]
    return float(f"{value:.{_DIGITS}g}") if isinstance(value, float) else value
