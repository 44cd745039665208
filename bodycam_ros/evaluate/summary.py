"""An evaluation in figures: the content of ``summary.json``."""

import math
from dataclasses import asdict
from typing import Any

import numpy as np

from bodycam_ros.evaluate.agreement_figures import agreement_figures
from bodycam_ros.evaluate.comparison import Comparison, Distribution, spread
from bodycam_ros.evaluate.constraints import constraint_figures
from bodycam_ros.evaluate.equipment_figures import equipment_figures
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.gait_figures import gait_figures
from bodycam_ros.evaluate.health import CameraHealth
from bodycam_ros.evaluate.sliding import Sliding
from bodycam_ros.results.camera_record import StationRecord
from bodycam_ros.timing.clock_state import ClockHistory
from bodycam_ros.verdict import Verdict

CM_PER_M, MM_PER_M = 100.0, 1000.0
MS_PER_S, PPM = 1000.0, 1e6


def summary(evaluation: Evaluation) -> dict[str, Any]:
    """Figures by name, the unit at the end of the name; what is unknown is None.

    ``truth`` and ``sliding_against_truth`` hold the measures against the truth, if there is one; ``equipment`` how the
    body was coupled to it.
    """
    solved = evaluation.solved
    figures: dict[str, Any] = {
        "duration_s": 1e-9 * (solved.end_ns - solved.start_ns + solved.frame_ns),
        "frame_s": 1e-9 * solved.frame_ns,
        "instants": len(solved.stamps_ns),
        "instants_without_camera": int(evaluation.blind.sum()),
        "image_coverage": evaluation.image_coverage,
        "verdict": _verdict(evaluation.verdict),
        "gaps_s": [list(gap) for gap in evaluation.gaps],
        "root_position_sigma_mm": spread(MM_PER_M * evaluation.position_sigma),
        "root_rotation_sigma_deg": spread(np.degrees(evaluation.rotation_sigma)),
        "jitter_mm": spread(MM_PER_M * evaluation.jitter),
        "sliding": {foot: _sliding(sliding) for foot, sliding in evaluation.sliding.items()},
        "joint_ranges_deg": {name: np.degrees(limits).tolist() for name, limits in evaluation.angle_ranges.items()},
        "cameras": {health.camera: _camera(health) for health in evaluation.cameras},
    }
    if solved.stations:
        figures["stations"] = {record.station: _station(record) for record in solved.stations}
    if solved.equipment is not None:
        figures["equipment"] = equipment_figures(solved.equipment, solved.start_ns)
    if evaluation.comparison is not None:
        figures["truth"] = truth_figures(evaluation.comparison)
        figures["sliding_against_truth"] = {
            foot: {"solved": _sliding(of.solved), "true": _sliding(of.true), "beyond": _sliding(of.beyond)}
            for foot, of in evaluation.true_sliding.items()
        }
    if (clock := evaluation.same_motion) is not None:
        figures["same_motion"] = {"correlation": clock.likeness, "by_chance": clock.chance}
    if evaluation.agreement is not None:
        figures["agreement"] = agreement_figures(evaluation.agreement)
    if evaluation.constraints is not None:
        figures["constraints"] = constraint_figures(evaluation.constraints)
    for name, gait in (("gait", evaluation.gait), ("true_gait", evaluation.true_gait)):
        if gait is not None:
            figures[name] = gait_figures(gait)
    known: dict[str, Any] = _without_nan(figures)
    return known


def truth_figures(comparison: Comparison) -> dict[str, Any]:
    """The measures against the truth; lengths in centimetres and angles in degrees, as in A section 5.1."""
    angles = [np.degrees(joint.angle_errors) for joint in comparison.joints.values()]
    rotations = [np.degrees(joint.rotation_errors) for joint in comparison.joints.values()]
    per_joint = {
        segment: {"position_cm": float(CM_PER_M * comparison.position_errors[:, column].mean())}
        for column, segment in enumerate(comparison.segments)
    }
    for segment, angle, rotation in zip(comparison.joints, angles, rotations, strict=True):
        per_joint[segment] |= {"angle_deg": float(angle.mean()), "rotation_deg": float(rotation.mean())}
    return {
        "frames": len(comparison.stamps_ns),
        "coverage": comparison.coverage,
        "joints": len(comparison.segments),
        "links_missing": list(comparison.missing),
        "position_cm": spread(CM_PER_M * comparison.position_errors),
        "sim_position_cm": spread(CM_PER_M * comparison.similarity_errors),
        "scale": comparison.scale,
        "tilt_deg": math.degrees(comparison.tilt),
        "angle_deg": spread(np.array(angles)),
        "rotation_deg": spread(np.array(rotations)),
        "per_joint": per_joint,
    }


def _sliding(sliding: Sliding) -> dict[str, Any]:
    return {
        "stances": sliding.stances,
        "standing_s": sliding.standing,
        "mean_mm": MM_PER_M * sliding.mean,
        "max_mm": MM_PER_M * sliding.max,
        "way_mm": MM_PER_M * sliding.way,
    }


def _verdict(verdict: Verdict) -> dict[str, Any]:
    findings = [asdict(finding) | {"level": finding.level.word} for finding in verdict.findings]
    return {"level": verdict.level.word, "text": verdict.text, "findings": findings}


def _camera(health: CameraHealth) -> dict[str, Any]:
    figures = {
        "images": health.images,
        "registered": health.registered,
        "sight": {sight.label: share for sight, share in health.sights.items()},
        "longest_lost_s": health.longest_lost_s,
        "tracks": health.tracks,
        "landmarks": health.landmarks,
        "image_motion_px": asdict(health.image_motion),
        "position_gap_mm": _scaled(health.position_gap, MM_PER_M),
        "rotation_gap_deg": _scaled(health.rotation_gap, math.degrees(1.0)),
    }
    if health.timing is not None:
        figures["clock"] = _clock(health.timing)
    if health.reprojection is not None:
        figures["reprojection_px"] = asdict(health.reprojection)
    return figures


def _station(record: StationRecord) -> dict[str, Any]:
    return {
        "images": len(record.stamps_ns),
        "seen": float(record.sees.mean()),
        "segments": float(record.segments.mean()),
        "confidence": float(record.confidence.mean()),
    }


def _clock(timing: ClockHistory) -> dict[str, Any]:
    """The clock at the end; ``is_off``: not that of the recording; ``held_from_s``: when it became another."""
    clock, first_ns = timing.latest, timing.clocks[0].since_ns
    return {
        "is_off": timing.is_off,
        "ahead_ms": MS_PER_S * clock.offset,
        "ahead_sigma_ms": MS_PER_S * clock.offset_sigma,
        "drift_ppm": PPM * clock.drift,
        "drift_sigma_ppm": PPM * clock.drift_sigma,
        "held_from_s": [1e-9 * (later.since_ns - first_ns) for later in timing.clocks[1:]],
        "readout_ms": MS_PER_S * timing.readout_time,
        "readout_sigma_ms": MS_PER_S * timing.readout_sigma,
    }


def _scaled(distribution: Distribution, factor: float) -> dict[str, float]:
    return {name: factor * value for name, value in asdict(distribution).items()}


def _without_nan(value: Any) -> Any:
    """JSON knows no NaN."""
    if isinstance(value, dict):
        return {name: _without_nan(inner) for name, inner in value.items()}
    if isinstance(value, list):
        return [_without_nan(inner) for inner in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value
