"""The report of a calibrated body: sections for terminal and page, the page, and figures for the body file."""

import math
from collections.abc import Iterable, Sequence
from io import BytesIO
from pathlib import Path
from typing import Any

import msgspec
import numpy as np
from matplotlib.axes import Axes

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.stick_figure import body_bones
from bodycam_ros.calibration.anthropometry import SegmentName, mirrored
from bodycam_ros.calibration.diagnosis import BoneDiagnosis, CalibrationDiagnosis, CameraDiagnosis, JointDiagnosis
from bodycam_ros.evaluate.page import Page, Picture, Section, Table, number, render_page
from bodycam_ros.picture_style import INK, QUIET, WARNING, open_picture, panel_title, side_colour
from bodycam_ros.whole_file import write_whole

_SIZE_INCHES = (9.0, 7.5)
_FRONT = [1, 2]
"""Axes of the N-pose (x forward, y left, z up) that are across and up on the screen."""

_LABEL_ROOM_M, _NAME_ROOM_M = 0.15, 0.5
_LABEL_STEP_M = 0.06  # between two labels of a column
_MM_PER_M, _MS_PER_S = 1000.0, 1000.0
_DIGITS = 4


def write_html_report(body: BodyModel, diagnosis: CalibrationDiagnosis, path: Path) -> None:
    """Write the page, whole or not at all.

    Raises:
        OutputError: the file cannot be written.
    """
    write_whole(path, html_report(body, diagnosis))


def html_report(body: BodyModel, diagnosis: CalibrationDiagnosis) -> str:
    """The page as an HTML 5 document."""
    caption = "The N-pose from the front; red: see the warnings."
    picture = Section(pictures=(Picture(body_png(body, diagnosis), caption),))
    warnings = Section("Warnings", warnings=diagnosis.warnings)
    lines = [summary_line(diagnosis), *([] if diagnosis.warnings else ["No warnings."])]
    first = [warnings, picture] if diagnosis.warnings else [picture]
    return render_page(Page(f"Body {body.name}", lines, [*first, *report_sections(diagnosis)]))


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


def report_sections(diagnosis: CalibrationDiagnosis) -> list[Section]:
    """A section with a table each, in the order in which a person should read them."""
    return [_joints(diagnosis.joints), _bones(diagnosis.bones), _cameras(diagnosis.cameras)]


def summary_line(diagnosis: CalibrationDiagnosis) -> str:
    """The recording and the person in one sentence."""
    start_s, end_s = diagnosis.rest_s
    stature_m = diagnosis.stature_m
    return (
        f"{diagnosis.duration_s:.1f} s recorded; N-pose from {start_s:.1f} to {end_s:.1f} s, facing "
        f"{math.degrees(diagnosis.heading_rad):.0f} deg from the map's x; "
        + ("too few bones for a stature" if stature_m is None else f"stature by the bones {stature_m:.2f} m")
    )


def _section(
    heading: str,
    note: str,
    columns: tuple[str, ...],
    text: set[int],
    rows: Sequence[tuple[str, ...]],
    flags: Iterable[str],
) -> Section:
    """A table whose rows with a warning are flagged."""
    flagged = frozenset(index for index, warning in enumerate(flags) if warning)
    return Section(heading, (note,), table=Table(columns, rows, frozenset(text), flagged))


def _joints(joints: tuple[JointDiagnosis, ...]) -> Section:
    rows = [
        (
            joint.name,
            joint.freedom,
            _triple(np.degrees(joint.exercised_rad), 0),
            number(_MM_PER_M * joint.gap_m, 1),
            _triple(_MM_PER_M * joint.sigma_m, 1),
        )
        for joint in joints
    ]
    note = (
        "moves: a ball turns about all axes, a hinge about one; exercised: range about its own three axes; gap: "
        "between the joint on the segment above and the one below, median; sigma: standard deviation forward, left, up"
    )
    columns = ("joint", "moves", "exercised [deg]", "gap [mm]", "sigma [mm]")
    return _section("joints", note, columns, {0, 1}, rows, (joint.advice for joint in joints))


def _bones(bones: tuple[BoneDiagnosis, ...]) -> Section:
    rows = [
        (
            SegmentName(bone.segment).words,
            bone.start,
            bone.end,
            number(_MM_PER_M * bone.length_m, 1),
            number(_MM_PER_M * bone.sigma_m, 1),
            _millimetres(bone.mirror_m),
            _millimetres(bone.asymmetry_m, signed=True),
            _millimetres(bone.expected_m, decimals=0),
        )
        for bone in bones
    ]
    note = "difference: less the other side; expected: of people of this stature (de Leva 1996)"
    lengths = ("length [mm]", "sigma [mm]", "other side [mm]", "difference [mm]", "expected [mm]")
    return _section("bones", note, ("bone", "from", "to", *lengths), {0, 1, 2}, rows, (b.warning for b in bones))


def _cameras(cameras: tuple[CameraDiagnosis, ...]) -> Section:
    rows = [
        (
            camera.camera,
            f"{100.0 * camera.registered:.1f}",
            number(_MM_PER_M * camera.residual_m, 1),
            number(math.degrees(camera.residual_rad), 2),
            number(_MM_PER_M * camera.moved_m, 1),
            number(math.degrees(camera.turned_rad), 2),
            number(camera.slipped_s, 1),
            "" if camera.readout is None else number(_MS_PER_S * camera.readout.seconds, 2),
            number(_MS_PER_S * camera.clock_s, 1, signed=True),
        )
        for camera in cameras
    ]
    note = (
        "gap: from the registered pose to that of the body, median; moved, turned: lasting change on its segment; "
        "read-out: from the first row to the last; clock: ahead of the reference's (+) or behind, corrected"
    )
    columns = (
        "camera", "registered [%]", "gap [mm]", "gap [deg]", "moved [mm]", "turned [deg]", "slipped at [s]",
        "read-out [ms]", "clock [ms]",
    )  # fmt: skip
    return _section("cameras", note, columns, {0}, rows, (camera.warning for camera in cameras))


def _triple(values: Iterable[float], decimals: int) -> str:
    return " ".join(number(value, decimals) or "?" for value in values)


def _millimetres(length_m: float | None, decimals: int = 1, signed: bool = False) -> str:
    return "" if length_m is None else number(_MM_PER_M * length_m, decimals, signed)


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
