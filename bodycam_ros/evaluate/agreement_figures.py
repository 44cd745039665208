"""An agreement in figures, for ``summary.json``, and in sentences."""

from typing import Any

import numpy as np

from bodycam_ros.evaluate.agreement import Agreement, PointAgreement
from bodycam_ros.evaluate.alignment import NONE, SIMILARITY
from bodycam_ros.evaluate.anatomical_angles import PLANES, joint_name
from bodycam_ros.evaluate.angle_agreement import AngleAgreement
from bodycam_ros.evaluate.comparison import spread
from bodycam_ros.geometry import Array

_CM_PER_M = 100.0
_WITHIN = 1.96  # standard deviations on either side that 95 % lie within
_UNIT_NAMES = {1.0: "m", 0.01: "cm", 0.001: "mm", 0.0254: "inches"}
_MAX_NAMES = 12


def agreement_figures(agreement: Agreement) -> dict[str, Any]:
    """Figures by name, the unit at the end of the name."""
    clock, angles = agreement.clock, list(agreement.angle_errors.values())
    return {
        "with": agreement.name,
        "format": agreement.kind,
        "instants": len(agreement.stamps_ns),
        "align": agreement.align,
        "scale": agreement.scale,
        "unit_m": agreement.unit_m,
        "starts_at_s": clock.start_s,
        "starts_at_sigma_s": clock.start_sigma_s,
        "clock_rate": clock.rate,
        "clock_rate_sigma": clock.rate_sigma,
        "doubts": list(agreement.doubts),
        "names_left_out": list(agreement.left_out),
        "position_cm": spread(_CM_PER_M * agreement.position_errors),
        "position_rigid_mean_cm": _CM_PER_M * agreement.rigid_error,
        "angle_deg": spread(np.degrees(np.array(angles))) if angles else None,
        "points": {point.name: _point_figures(point) for point in agreement.points},
        "joints": {joint_name(angle.segment): _angle_figures(angle) for angle in agreement.angles},
    }


def _point_figures(point: PointAgreement) -> dict[str, Any]:
    return {
        "on": point.link,
        "place_fitted": point.is_fitted,
        "seen": float(np.isfinite(point.theirs[:, 0]).mean()),
        "position_cm": spread(_CM_PER_M * point.errors),
    }


def _angle_figures(angle: AngleAgreement) -> dict[str, Any]:
    columns = zip(PLANES, np.degrees(angle.ours).T, np.degrees(angle.theirs).T, strict=True)
    return {
        "from": "centres of joints" if angle.from_points else "rotations of bones",
        "angle_deg": spread(np.degrees(np.abs(angle.ours_turned - angle.theirs_turned))),
        "planes": {
            plane: {"error_deg": spread(np.abs(ours - theirs))} | limits_of_agreement(ours, theirs)
            for plane, ours, theirs in columns
            if np.isfinite(theirs).any()
        },
    }


def limits_of_agreement(ours: Array, theirs: Array) -> dict[str, float]:
    """Bias, 95 % limits and root mean square of the differences (Bland and Altman 1986); NaN of none."""
    differences = (ours - theirs)[np.isfinite(ours - theirs)]
    if not differences.size:
        return dict.fromkeys(("bias", "low", "high", "rmse"), np.nan)
    bias, sd = float(differences.mean()), float(differences.std())
    rmse = float(np.sqrt((differences**2).mean()))
    return {"bias": bias, "low": bias - _WITHIN * sd, "high": bias + _WITHIN * sd, "rmse": rmse}


def agreement_lines(agreement: Agreement) -> list[str]:
    """How the two were compared, in sentences."""
    clock = agreement.clock
    when = f"Their first frame is at {clock.start_s:.3f} s of this recording"
    if clock.start_sigma_s == 0.0:
        when += ", by its stamps."
    else:
        rate = "counts as ours"
        if clock.rate != 1.0:
            rate = f"counts seconds of {clock.rate:.5f} s (+-{clock.rate_sigma:.5f})"
        when += f" (+-{1e3 * clock.start_sigma_s:.1f} ms), and their clock {rate}."
    scale = f"{agreement.scale:.4f} ({100.0 * (agreement.scale - 1.0):+.2f} %)"
    if agreement.align == NONE:
        where = f"Worlds are taken to be the same; a similarity would have a scale of {scale}."
    elif agreement.align == SIMILARITY:
        rigid = f"{_CM_PER_M * agreement.rigid_error:.2f} cm"
        where = f"Worlds are aligned by a similarity of scale {scale}; without it joints are {rigid} off on average."
    else:
        where = f"Worlds are aligned rigidly; a similarity would have a scale of {scale}."
    lines = [f"{when} {where} {len(agreement.stamps_ns)} frames are compared."]
    if agreement.unit_m is not None:
        unit = _UNIT_NAMES.get(agreement.unit_m, f"{agreement.unit_m:.4f} m")
        lines.append(f"The file does not declare its unit; by the size of the body it is {unit}.")
    if agreement.left_out:
        names = ", ".join(agreement.left_out[:_MAX_NAMES]) + (" ..." if len(agreement.left_out) > _MAX_NAMES else "")
        lines.append(f"Not compared, because their names are unknown (--points maps them): {names}.")
    return lines
