"""The diagnosis of a calibration as the ``report`` of a body file: plain numbers, in the units of their names."""

from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis

_DIGITS = 4


def body_report(diagnosis: CalibrationDiagnosis) -> dict[str, Any]:
    """Figures by joint, bone and camera; bones are named ``segment: start-end``."""
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
