"""A calibration's figures: as sections for terminal and page alike, and as the ``report`` of a body file."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from bodycam_ros.calibration.anthropometry import SegmentName
from bodycam_ros.calibration.diagnosis import BoneDiagnosis, CalibrationDiagnosis, CameraDiagnosis, JointDiagnosis
from bodycam_ros.evaluate.page import Section, Table, number

_MM_PER_M, _MS_PER_S = 1000.0, 1000.0
_DIGITS = 4


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
    """The same without names that the key has, and without empty values."""
    return {name: value for name, value in values.items() if name not in names and value not in ("", None)}


def _plain(value: Any) -> Any:
    if is_dataclass(value):
        return {f.name: _plain(getattr(value, f.name)) for f in fields(value)}
    if isinstance(value, np.ndarray | tuple | list):
        return [_plain(item) for item in value]
    if isinstance(value, float | np.floating):
        return float(f"{float(value):.{_DIGITS}g}")
    return value
