"""The figures of a diagnosis: as tables of text for terminal and page alike, and as the ``report`` of a body file."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, fields, is_dataclass
from typing import Any

import numpy as np

from bodycam_ros.calibration.anthropometry import SegmentName
from bodycam_ros.calibration.diagnosis import (
    BoneDiagnosis,
    CalibrationDiagnosis,
    CameraDiagnosis,
    JointDiagnosis,
    RefinementGain,
)

MM_PER_M, MS_PER_S = 1000.0, 1000.0

_DIGITS = 4

_CLOCK_OFF_S = 3e-4
"""Clocks that are off by less are called right: triggers are no better."""


@dataclass(frozen=True)
class ReportTable:
    """One table.

    Attributes:
        title: what it is about.
        note: how to read it.
        columns: headings with units; those in ``text_columns`` hold words, the others numbers.
        text_columns: indices of columns to be set flush left.
        rows: cells, empty where a figure is not known.
        flagged: indices of rows that a warning speaks of.
    """

    title: str
    note: str
    columns: tuple[str, ...]
    text_columns: frozenset[int]
    rows: tuple[tuple[str, ...], ...]
    flagged: frozenset[int] = frozenset()


def report_tables(diagnosis: CalibrationDiagnosis) -> list[ReportTable]:
    """All tables, in the order in which a person should read them."""
    tables = [
        _joint_motions(diagnosis.joints),
        _joint_places(diagnosis.joints),
        _bones(diagnosis.bones),
        _cameras(diagnosis.cameras),
        _rows(diagnosis.cameras),
        *_clocks(diagnosis.cameras),
    ]
    return tables if diagnosis.refinement is None else [*tables, _refinement(diagnosis.refinement)]


def summary_line(diagnosis: CalibrationDiagnosis) -> str:
    """The recording and the person in one sentence."""
    start_s, end_s = diagnosis.rest_s
    stature_m = diagnosis.stature_m
    return (
        f"{diagnosis.duration_s:.1f} s recorded; N-pose held from {start_s:.1f} to {end_s:.1f} s, facing "
        f"{math.degrees(diagnosis.heading_rad):.0f} deg from the map's x; "
        + ("too few bones for a stature" if stature_m is None else f"stature by the bones {stature_m:.2f} m")
    )


def _joint_motions(joints: tuple[JointDiagnosis, ...]) -> ReportTable:
    rows = [
        (
            joint.name,
            joint.freedom,
            _triple(np.degrees(joint.exercised_rad), 0),
            " ".join(f"{math.degrees(low):.0f}..{math.degrees(high):.0f}" for low, high in joint.limits),
            str(joint.frames),
            " ".join(joint.cameras),
        )
        for joint in joints
    ]
    return ReportTable(
        "joints: motion",
        "moves: a ball turns about all axes, a hinge about one; exercised: range about its own three axes; limits: "
        "extremes of each joint angle; moments: at which cameras on both sides knew where they were",
        ("joint", "moves", "exercised [deg]", "limits [deg]", "moments", "cameras"),
        frozenset({0, 1, 3, 5}),
        tuple(rows),
        _flagged(joint.advice for joint in joints),
    )


def _joint_places(joints: tuple[JointDiagnosis, ...]) -> ReportTable:
    rows = [
        (
            joint.name,
            _triple(joint.singular_values, 2),
            joint.placed_by,
            _number(MM_PER_M * joint.residual_m, 1),
            _number(MM_PER_M * joint.refined_residual_m, 1),
            _triple(MM_PER_M * joint.sigma_m, 1),
        )
        for joint in joints
    ]
    return ReportTable(
        "joints: place",
        "place known: how well the motion tells it along three axes, 0 not at all (singular values, A eq. 14); gap: "
        "between where the segment above and the one below have the joint, median, before and after the refinement; "
        "sigma: standard deviation forward, left, up",
        ("joint", "place known", "placed by", "gap before [mm]", "gap after [mm]", "sigma [mm]"),
        frozenset({0, 2}),
        tuple(rows),
        _flagged(joint.advice for joint in joints),
    )


def _bones(bones: tuple[BoneDiagnosis, ...]) -> ReportTable:
    rows = [
        (
            SegmentName(bone.segment).words,
            bone.start,
            bone.end,
            _number(MM_PER_M * bone.length_m, 1),
            _number(MM_PER_M * bone.sigma_m, 1),
            _millimetres(bone.mirror_m, 1),
            _millimetres(bone.asymmetry_m, 1, sign="+"),
            _millimetres(bone.expected_m, 0),
        )
        for bone in bones
    ]
    return ReportTable(
        "bones",
        "difference: less the other side; expected: of people of this stature (de Leva 1996)",
        (
            "bone",
            "from",
            "to",
            "length [mm]",
            "sigma [mm]",
            "other side [mm]",
            "difference [mm]",
            "expected [mm]",
        ),
        frozenset({0, 1, 2}),
        tuple(rows),
        _flagged(bone.warning for bone in bones),
    )


def _cameras(cameras: tuple[CameraDiagnosis, ...]) -> ReportTable:
    rows = [
        (
            camera.camera,
            camera.segment,
            str(camera.images),
            f"{100.0 * camera.registered:.1f}",
            _number(MM_PER_M * camera.residual_m, 1),
            _number(math.degrees(camera.residual_rad), 2),
            _number(MM_PER_M * camera.moved_m, 1),
            _number(math.degrees(camera.turned_rad), 2),
            "" if camera.slipped_s is None else f"{camera.slipped_s:.1f}",
        )
        for camera in cameras
    ]
    return ReportTable(
        "cameras",
        "registered: images in which it knew where it was in the map; gap: from there to where the body puts it, "
        "median; moved, turned: lasting change on its segment",
        (
            "camera",
            "segment",
            "images",
            "registered [%]",
            "gap [mm]",
            "gap [deg]",
            "moved [mm]",
            "turned [deg]",
            "slipped at [s]",
        ),
        frozenset({0, 1}),
        tuple(rows),
        _flagged(camera.warning for camera in cameras),
    )


def _rows(cameras: tuple[CameraDiagnosis, ...]) -> ReportTable:
    known = [(camera.camera, camera.readout) for camera in cameras if camera.readout is not None]
    return ReportTable(
        "cameras: rows",
        "read-out: from the exposure of the first row to that of the last, 0 where all are exposed together",
        ("camera", "read-out [ms]", "sigma [ms]"),
        frozenset({0}),
        tuple(
            (camera, _number(1e3 * of.seconds, 2), "given" if of.is_given else _number(1e3 * of.sigma, 2))
            for camera, of in known
        ),
    )


def _clocks(cameras: tuple[CameraDiagnosis, ...]) -> list[ReportTable]:
    """The clocks that were off; no table where none was."""
    off = [camera for camera in cameras if abs(camera.clock_s) > _CLOCK_OFF_S]
    if not off:
        return []
    note = "ahead of the reference's (+) or behind, as the body's motion tells; corrected"
    rows = tuple((camera.camera, _number(MS_PER_S * camera.clock_s, 1, sign="+")) for camera in off)
    return [ReportTable("clocks", note, ("camera", "clock [ms]"), frozenset({0}), rows)]


def _refinement(gain: RefinementGain) -> ReportTable:
    return ReportTable(
        "refinement",
        f"landmarks observed {gain.landmarks} times at {gain.instants} moments, {gain.iterations} iterations; joints "
        f"moved by {_number(MM_PER_M * gain.moved_m, 1)} mm, median, {_number(MM_PER_M * gain.moved_most_m, 1)} mm at "
        "most",
        ("median of", "before", "after"),
        frozenset({0}),
        (("reprojection error [px]", _number(gain.before_px, 2), _number(gain.after_px, 2)),),
    )


def _flagged(warnings: Iterable[str]) -> frozenset[int]:
    return frozenset(index for index, warning in enumerate(warnings) if warning)


def _triple(values: Iterable[float], decimals: int) -> str:
    return " ".join(_number(value, decimals) or "?" for value in values)


def _millimetres(length_m: float | None, decimals: int, sign: str = "") -> str:
    return "" if length_m is None else _number(MM_PER_M * length_m, decimals, sign)


def _number(value: float, decimals: int, sign: str = "") -> str:
    return f"{value:{sign}.{decimals}f}" if math.isfinite(value) else ""


def body_report(diagnosis: CalibrationDiagnosis) -> dict[str, Any]:
    """Plain numbers by joint, bone and camera, in the units of their names; bones are named ``segment: start-end``."""
    report: dict[str, Any] = {"source": "range of motion"}
    for f in fields(diagnosis):
        if f.name not in ("joints", "bones", "cameras"):
            report[f.name] = _plain(getattr(diagnosis, f.name))
    report["warnings"] = list(diagnosis.warnings)
    report["joints"] = {joint.name: _without(_plain(joint), "name", "parent", "child") for joint in diagnosis.joints}
    report["bones"] = {
        f"{bone.segment}: {bone.start}-{bone.end}": _without(_plain(bone), "segment", "start", "end")
        for bone in diagnosis.bones
    }
    report["cameras"] = {camera.camera: _without(_plain(camera), "camera", "segment") for camera in diagnosis.cameras}
    return report


def _without(values: dict[str, Any], *names: str) -> dict[str, Any]:
    """The same without what the key says already, and without what is empty."""
    return {name: value for name, value in values.items() if name not in names and value not in ("", None)}


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray | tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{float(value):.{_DIGITS}g}")
    return value
