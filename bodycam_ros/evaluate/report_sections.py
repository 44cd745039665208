"""The tables of a report, of the figures of an evaluation: for page and terminal alike."""

from collections.abc import Iterator, Sequence

from msgspec.structs import asdict

from bodycam_ros.evaluate.figures import AgreementFigures, EquipmentFigures, EvaluationFigures, GaitFigures
from bodycam_ros.evaluate.gait import CRITERION, MEASURES, MIN_STRIDES_OF_SIDE
from bodycam_ros.evaluate.gait_cycle import CONVENTION
from bodycam_ros.evaluate.sections import Columns, Section, column_table
from bodycam_ros.evaluate.sliding import ALL
from bodycam_ros.files.shown import few

CENTRES = "camera centres against the truth [mm]"
"""Heading of the section on them, before and after the optimisation."""

WITHOUT = "with the equipment and without"
"""Heading of the section on what it changes."""

ANGLES = "joint angles"
"""Heading of the section on them, on a page with their picture."""

_SPREAD: Columns = tuple((name, name, ".3f") for name in ("mean", "sd", "min", "median", "p95", "max"))
_MEASURES = {
    "position_cm": ("position [cm]", "distance of the joint after one rigid alignment"),
    "angle_deg": ("angle [deg]", "difference of the angles by which the joint has turned since the first frame"),
    "rotation_deg": ("rotation [deg]", "angle between both rotations of the joint; it has the axis, too"),
}
"""Errors of ``SegmentErrors``: heading, and what it is the error of."""
_PLANES: Columns = (
    ("error, mean [deg]", "error_deg.mean", ".2f"), ("max", "error_deg.max", ".2f"), ("bias", "bias", "+.2f"),
    ("95 % from", "low", "+.2f"), ("to", "high", "+.2f"), ("rmse", "rmse", ".2f"),
)  # fmt: skip
_PLANES_NOTE = (
    "bias and the range of 95 % of the differences: this result minus the other system (Bland and Altman 1986); if "
    "both have rotations of bones, two constant rotations per joint are fitted, as each system defines its own axes"
)
_CAMERAS: Columns = (
    ("images", "images", "d"), ("registered", "registered", ".1%"), ("lost [s]", "longest_lost_s", ".2f"),
    ("landmarks", "landmarks", ".0f"),
    ("gap [mm]", "position_gap_mm.median", ".1f"), ("gap [deg]", "rotation_gap_deg.median", ".2f"),
    ("error [px]", "reprojection_px.median", ".2f"),
)  # fmt: skip
_CAMERAS_NOTE = {
    "lost": "the longest time without a pose",
    "landmarks": "median number in an image",
    "gap": "from the registered to the solved pose, median",
    "error": "of landmarks in the solved pose, median",
}
_STATIONS: Columns = (
    ("images", "images", "d"), ("observed", "seen", ".1%"), ("segments", "segments", ".1f"),
    ("confidence", "confidence", ".1%"),
)  # fmt: skip
_STATIONS_NOTE = {
    "observed": "share of the images that measure a segment's pose",
    "confidence": "share of the contour that does",
}
_CLOCKS: Columns = (
    ("offset [ms]", "ahead_ms", "+.1f"), ("+-", "ahead_sigma_ms", ".1f"), ("drift [ppm]", "drift_ppm", "+.0f"),
    ("+-", "drift_sigma_ppm", ".0f"), ("set at [s]", "set", ""), ("read-out [ms]", "readout_ms", ".2f"),
    ("+-", "readout_sigma_ms", ".2f"),
)  # fmt: skip
_SENSORS: Columns = (
    ("samples a second", "rate_hz", ".0f"), ("gyroscope noise [deg/s/√Hz]", "gyro_noise_deg_s", ".3f"),
    ("accelerometer noise [µg/√Hz]", "accelerometer_noise_micro_g", ".0f"), ("bias [deg/s]", "rest_bias_deg_s", ".2f"),
    ("bias change [deg/s]", "bias_change_deg_s", ".3f"), ("residual [deg/s]", "residual_deg_s", ".2f"),
)  # fmt: skip
_SENSORS_NOTE = {
    "gyroscope noise": "at rest",
    "accelerometer noise": "at rest",
    "bias": "of the gyroscope at rest",
    "bias change": "the gyroscope as the body file corrects it, less the solved camera, median",
    "residual": "what remains of that, median from frame to frame",
}
_SLIDING: Columns = (
    ("stances", "stances", "d"), ("stance [s]", "standing_s", ".2f"), ("mean [mm]", "mean_mm", ".2f"),
    ("max [mm]", "max_mm", ".2f"), ("path [mm]", "path_mm", ".2f"), ("true foot [mm]", "true_mean_mm", ".2f"),
    ("beyond it [mm]", "beyond_mean_mm", ".2f"),
)  # fmt: skip
_ATTACHMENTS: Columns = (
    ("active", "held", ".1%"), ("mean [mm]", "deviation_mm.mean", ".1f"), ("p95 [mm]", "deviation_mm.p95", ".1f"),
    ("max [mm]", "deviation_mm.max", ".1f"), ("apart [mm]", "apart_mm.median", ".1f"), ("released [s]", "released", ""),
)  # fmt: skip
_GAIT: Columns = (
    ("mean", "mean", ".3g"), ("sd", "sd", ".2g"), ("left", "left", ".3g"), ("right", "right", ".3g"),
    ("symmetry [%]", "symmetry_percent", "+.1f"), ("95 % from", "symmetry_low_percent", "+.1f"),
    ("to", "symmetry_high_percent", "+.1f"), ("truth", "true", ".3g"),
)  # fmt: skip
_CYCLE: Columns = (
    ("strides", "strides", "d"), ("most flexion [deg]", "peak_deg", ".1f"), ("at [%]", "peak_percent", ".0f"),
    ("least flexion [deg]", "trough_deg", ".1f"), ("at [%]", "trough_percent", ".0f"), ("sd [deg]", "sd_deg", ".1f"),
)  # fmt: skip
_WITHOUT: Columns = tuple(
    (f"{name.removesuffix('_it')}, {each}", f"{name}.{each}", ".2f")
    for name in ("with_it", "without")
    for each in ("mean", "sd", "max")
)
_CENTRES: Columns = tuple(
    (f"{name}, {each}", f"{name}.{each}", ".2f") for name in ("before", "after") for each in ("mean", "sd", "max")
)
_MAX_STRETCHES = 3


def report_sections(figures: EvaluationFigures) -> Iterator[Section]:
    """A section with a table for each kind of figures of an evaluation, joint angles and walking first."""
    if figures.gait_cycle is not None:
        note = (
            f"from a contact of the heel (0 %) to the next of the same foot (100 %); {CONVENTION}; the mean over the "
            "strides, sd: standard deviation over them, its mean over the cycle"
        )
        yield column_table(ANGLES, "joint, side", _CYCLE, figures.gait_cycle, note)
    if figures.gait is not None:
        yield _walking_section(figures.gait)
    if (truth := figures.truth) is not None:
        note = (
            f"positions after one rigid alignment; coverage {truth.coverage:.1%}, scale {truth.scale:.5f}, tilt "
            f"{truth.tilt_deg:.3f} deg"
        )
        if truth.links_missing:
            note += f"; in the truth, but not in the body: {', '.join(truth.links_missing)}"
        rows = {
            "position [cm]": truth.position_cm,
            "position, scale fitted [cm]": truth.sim_position_cm,
            "angle [deg]": truth.angle_deg,
            "rotation [deg]": truth.rotation_deg,
        }
        yield column_table("against the truth", "measure", _SPREAD, rows, note)
        for name, (heading, meaning) in _MEASURES.items():
            errors = {segment: getattr(each, name) for segment, each in truth.per_joint.items()}
            known = {segment: each for segment, each in errors.items() if each is not None}
            yield column_table(f"joints against the truth: {heading}", "segment", _SPREAD, known, meaning)
    if figures.camera_centres_mm is not None:
        note = "before: each camera registered alone; after: all cameras and the body solved together (A figure 6)"
        yield column_table(CENTRES, "camera", _CENTRES, figures.camera_centres_mm, note)
    if figures.agreement is not None:
        yield from _agreement_sections(figures.agreement)
    if cameras := figures.cameras:
        faulty = {finding["subject"] for finding in figures.verdict.findings}
        lost = {name for name, camera in cameras.items() if not camera.registered}
        yield column_table("cameras", "camera", _CAMERAS, cameras, _CAMERAS_NOTE, faulty | lost)
    if stations := figures.stations:
        blind = {name for name, each in stations.items() if not each.seen}
        yield column_table("static cameras", "camera", _STATIONS, stations, _STATIONS_NOTE, blind)
    clocks = {name: camera.clock for name, camera in cameras.items() if camera.clock is not None}
    if any(clock.is_off for clock in clocks.values()):
        shown = {
            name: asdict(clock) | {"set": " ".join(f"{s:.1f}" for s in clock.held_from_s)}
            for name, clock in clocks.items()
        }
        note = (
            "offset: how far the camera's clock is ahead of the recording's time (+) or behind it (-), corrected; the "
            "last offset, if the clock was set during the recording"
        )
        yield column_table("clocks", "camera", _CLOCKS, shown, note)
    if figures.sensors:
        yield column_table("inertial sensors", "camera", _SENSORS, figures.sensors, _SENSORS_NOTE)
    rows = {
        "root position sigma [mm]": figures.root_position_sigma_mm,
        "root rotation sigma [deg]": figures.root_rotation_sigma_deg,
        "jitter [mm]": figures.jitter_mm,
    }
    yield column_table("body", "measure", _SPREAD, rows)
    if figures.equipment is not None:
        yield from equipment_sections(figures.equipment)
    if figures.without_equipment is not None:
        note = "distance of an attached point from its point on the equipment, where its pose is known"
        yield column_table(WITHOUT, "measure", _WITHOUT, figures.without_equipment, note)
    if ALL in figures.sliding and figures.sliding[ALL].stances:
        note = (
            "mean, max: horizontal distance of heel or ball from its mean position in a stance; path: length of its "
            "trajectory in a stance; true foot: the same of the ground truth; beyond it: the same of the foot's error"
        )
        yield column_table("sliding of feet in stance", "foot", _SLIDING, figures.sliding, note)


def _walking_section(gait: GaitFigures) -> Section:
    counts = ", ".join(f"{count} {side}" for side, count in gait.strides.items())
    note = f"strides: {counts}; a stride begins where the heel is furthest ahead of the pelvis (Zeni 2008); "
    if min(gait.strides.values()) < MIN_STRIDES_OF_SIDE:
        note += f"nothing can be said about symmetry: it needs {MIN_STRIDES_OF_SIDE} strides of each side"
    else:
        note += (
            "symmetry: left less right over their mean, and the 95 % interval by the spread of the strides; where it "
            "holds zero, no difference of the sides is shown"
        )
    rows = {name: getattr(gait, key) for key, (name, _) in MEASURES.items()}
    return column_table("walking", "measure", _GAIT, rows, f"{note}; walking is {CRITERION}")


def _agreement_sections(agreement: AgreementFigures) -> Iterator[Section]:
    rows = {"joint position [cm]": agreement.position_cm, "joint angle [deg]": agreement.angle_deg}
    rows |= {f"{name} [cm]": point.position_cm for name, point in agreement.points.items()}
    rows = {name: spread for name, spread in rows.items() if spread is not None}
    yield column_table(f"against {agreement.other} ({agreement.format})", "error", _SPREAD, rows)
    planes = {
        f"{joint}, {plane}": figures
        for joint, each in agreement.joints.items()
        for plane, figures in each.planes.items()
    }
    if planes:
        yield column_table("joint angles by anatomical plane", "joint, plane", _PLANES, planes, _PLANES_NOTE)


def equipment_sections(figures: EquipmentFigures) -> Iterator[Section]:
    """A table of the attachments, and one of the lengths that were estimated, if any.

    Args:
        figures: of ``equipment_figures``.
    """
    placed_s = figures.placed_from_s
    placed = "its pose was never known" if placed_s is None else f"its pose is known from {placed_s:.2f} s"
    note = (
        f"{placed}; active: share of the frames; mean, p95, max: distance between the points while active; apart: "
        "median distance between the points while released"
    )
    rows = {name: asdict(each) | {"released": _stretches(each.let_go_s)} for name, each in figures.attachments.items()}
    yield column_table(f"equipment {figures.name}", "attachment", _ATTACHMENTS, rows, note)
    if figures.lengths:
        columns = ("value [mm]", "value_mm", ".1f"), ("+-", "sigma_mm", ".1f")
        yield column_table("estimated lengths of the equipment", "length", columns, figures.lengths)


def _stretches(stretches: Sequence[Sequence[float]]) -> str:
    return few((f"{start:.2f} to {end:.2f}" for start, end in stretches), _MAX_STRETCHES)
