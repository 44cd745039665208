"""An agreement in figures: its part of ``summary.json``."""

from dataclasses import asdict
from typing import Any

import numpy as np

from bodycam_ros.evaluate.agreement.agreement import Agreement, AngleAgreement, PointAgreement
from bodycam_ros.evaluate.agreement.anatomical_angles import PLANES, joint_name
from bodycam_ros.evaluate.agreement.spread import LimitsOfAgreement, Spread
from bodycam_ros.geometry import Array

CM_PER_M = 100.0
DIRECTIONS = ("forward", "left", "up")


def agreement_figures(agreement: Agreement) -> dict[str, Any]:
    """Figures by name, the unit at the end of the name."""
    turned = list(agreement.angle_errors.values())
    return {
        "with": agreement.name,
        "format": agreement.kind,
        "instants": len(agreement.stamps_ns),
        "align": agreement.align,
        "scale": agreement.scale,
        "unit_m": agreement.unit_m,
        "starts_at_s": agreement.clock.start_s,
        "starts_at_sigma_s": agreement.clock.start_sigma_s,
        "clock_rate": agreement.clock.rate,
        "clock_rate_sigma": agreement.clock.rate_sigma,
        "clock_likeness": agreement.clock.likeness,
        "clock_lead": agreement.clock.lead,
        "doubts": list(agreement.doubts),
        "names_left_out": list(agreement.left_out),
        "position_cm": asdict(Spread.of(CM_PER_M * agreement.position_errors)),
        "position_rigid_mean_cm": CM_PER_M * agreement.rigid_error,
        "angle_deg": asdict(Spread.of(np.degrees(np.array(turned)))) if turned else None,
        "points": {point.name: _point(point) for point in agreement.points},
        "joints": {joint_name(angle.segment): _angle(angle) for angle in agreement.angles},
    }


def _point(point: PointAgreement) -> dict[str, Any]:
    along = {
        direction: _limits(CM_PER_M * errors, np.zeros(len(errors)))
        for direction, errors in zip(DIRECTIONS, point.errors_along.T, strict=True)
    }
    return {
        "on": point.link,
        "place_fitted": point.is_fitted,
        "seen": float(np.isfinite(point.theirs[:, 0]).mean()),
        "position_cm": asdict(Spread.of(CM_PER_M * point.errors)),
        "along_cm": along,
    }


def _angle(angle: AngleAgreement) -> dict[str, Any]:
    ours, theirs = np.degrees(angle.ours), np.degrees(angle.theirs)
    planes = {
        plane: {"error_deg": asdict(Spread.of(np.abs(a - b)))} | _limits(a, b)
        for plane, a, b in zip(PLANES, ours.T, theirs.T, strict=True)
        if np.isfinite(b).any()
    }
    turned = np.degrees(np.abs(angle.ours_turned - angle.theirs_turned))
    return {
        "from": "centres of joints" if angle.from_points else "rotations of bones",
        "angle_deg": asdict(Spread.of(turned)),
        "planes": planes,
    }


def _limits(ours: Array, theirs: Array) -> dict[str, float]:
    return asdict(LimitsOfAgreement.of(ours, theirs))
