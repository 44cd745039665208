"""The figures of an evaluation: what ``summary.json`` holds, by the same names; units are at the end of a name.

Figures that are unknown are NaN here and null in the file. What a recording does not have, such as a truth, makes its
figures None here and missing in the file.
"""

import json

import msgspec
import numpy as np
from numpy.typing import NDArray


class Spread(msgspec.Struct, frozen=True):
    """Statistics of values, in the unit of the figure that they are of.

    Attributes:
        mean, median, min, max, sd: the five of A section 5.1; ``sd`` is the standard deviation.
        p95: the 95th percentile.
    """

    mean: float
    median: float
    p95: float
    max: float
    min: float
    sd: float


def spread(values: NDArray[np.floating], factor: float = 1.0) -> Spread:
    """Statistics of values of any shape, times a factor; NaN ones do not count."""
    known = factor * values[np.isfinite(values)]
    if not known.size:
        return Spread(np.nan, np.nan, np.nan, np.nan, np.nan, np.nan)
    median, p95, most, least = np.percentile(known, [50, 95, 100, 0]).tolist()
    return Spread(float(known.mean()), median, p95, most, least, float(known.std()))


class ClockFigures(msgspec.Struct, frozen=True):
    """A camera's clock at the end.

    Attributes:
        is_off: whether it is not that of the recording.
        ahead_ms: by how much its stamps are ahead.
        held_from_s: times since the first image at which it was set.
    """

    is_off: bool
    ahead_ms: float
    ahead_sigma_ms: float
    drift_ppm: float
    drift_sigma_ppm: float
    held_from_s: list[float]
    readout_ms: float
    readout_sigma_ms: float


class CameraFigures(msgspec.Struct, frozen=True, omit_defaults=True):
    """A body camera.

    The registration has this camera alone, the solution all cameras and the body: a gap that stays is a mount that has
    moved or a wrong body, one that comes and goes bad registrations.

    Attributes:
        images: number.
        registered: share of the images, 0 to 1.
        sight: label of a ``CameraSight`` -> share of the images.
        longest_lost_s: longest time without a pose.
        landmarks: mean over the images; NaN of a slim bag.
        position_gap_mm, rotation_gap_deg: between registered and solved poses.
        clock: if the bag has it.
        reprojection_px: of landmarks in the solved pose, if the lens is known.
    """

    images: int
    registered: float
    sight: dict[str, float]
    longest_lost_s: float
    landmarks: float
    position_gap_mm: Spread
    rotation_gap_deg: Spread
    clock: ClockFigures | None = None
    reprojection_px: Spread | None = None


class StationFigures(msgspec.Struct, frozen=True):
    """A static camera: images, share of them that measure a segment, segments each, share of the contour that fits."""

    images: int
    seen: float
    segments: float
    confidence: float


class SensorFigures(msgspec.Struct, frozen=True):
    """An inertial sensor: noise and bias at rest, and the gyroscope against the solved camera.

    Attributes:
        bias_change_deg_s: median of the gyroscope, corrected by the body's calibration, less the solved angular
            velocity; NaN without a calibration.
        residual_deg_s: median of what remains; NaN without a calibration.
    """

    rate_hz: float
    gyro_noise_deg_s: float
    accelerometer_noise_micro_g: float
    rest_bias_deg_s: float
    bias_change_deg_s: float
    residual_deg_s: float


class SlidingFigures(msgspec.Struct, frozen=True, omit_defaults=True):
    """Sliding of a foot in its stances.

    Attributes:
        stances: number.
        standing_s: time of all stances.
        mean_mm, max_mm: horizontal distance from the mean place in a stance.
        path_mm: mean length of the path in a stance.
        true_mean_mm: mean of the true foot in its own stances, with a truth.
        beyond_mean_mm: mean of the error in these, with a truth.
    """

    stances: int
    standing_s: float
    mean_mm: float
    max_mm: float
    path_mm: float
    true_mean_mm: float | None = None
    beyond_mean_mm: float | None = None


class AttachmentFigures(msgspec.Struct, frozen=True):
    """An attachment of the equipment.

    Attributes:
        held: share of the states at which it was active.
        deviation_mm: distances of its points while it was active.
        apart_mm: the same while it was released.
        let_go_s: stretches of time at which it was released although the equipment was placed, since the start.
    """

    held: float
    deviation_mm: Spread
    apart_mm: Spread
    let_go_s: list[list[float]]


class LengthFigures(msgspec.Struct, frozen=True):
    """The last estimate of a length that the equipment's file leaves open."""

    value_mm: float
    sigma_mm: float


class EquipmentFigures(msgspec.Struct, frozen=True):
    """Equipment.

    Attributes:
        name: of the equipment.
        placed: share of the states at which its pose is known.
        placed_from_s: since the start; None, and null in the file, if never.
        attachments, lengths: by name.
    """

    name: str
    placed: float
    placed_from_s: float | None
    attachments: dict[str, AttachmentFigures]
    lengths: dict[str, LengthFigures]


class TwoSpreads(msgspec.Struct, frozen=True, rename={"with_it": "with"}):
    """One measure of two solutions: with the equipment, and without."""

    with_it: Spread
    without: Spread


class BeforeAndAfter(msgspec.Struct, frozen=True):
    """Errors of a camera's centre: registered alone, before the optimisation, and solved, after it."""

    before: Spread
    after: Spread


class SegmentErrors(msgspec.Struct, frozen=True, omit_defaults=True):
    """Errors of a segment's origin, and of its joint, if it has one.

    Attributes:
        position_cm: after one rigid alignment of the recording.
        angle_deg: the paper's measure: of the angle of the turn since the first frame (A figure 7a).
        rotation_deg: about a changing axis, too.
    """

    position_cm: Spread
    angle_deg: Spread | None = None
    rotation_deg: Spread | None = None


class TruthFigures(msgspec.Struct, frozen=True):
    """Errors against the truth, see ``Comparison``."""

    frames: int
    coverage: float
    joints: int
    links_missing: list[str]
    position_cm: Spread
    sim_position_cm: Spread
    scale: float
    tilt_deg: float
    angle_deg: Spread
    rotation_deg: Spread
    per_joint: dict[str, SegmentErrors]


class PlaneFigures(msgspec.Struct, frozen=True):
    """Differences of a joint's angles in an anatomical plane [deg], ours less theirs (Bland and Altman 1986).

    Attributes:
        error_deg: absolute differences.
        bias, low, high: mean difference, and the limits of 95 % of them.
        rmse: root mean square.
    """

    error_deg: Spread
    bias: float
    low: float
    high: float
    rmse: float


class JointFigures(msgspec.Struct, frozen=True, rename={"source": "from"}):
    """Angles of a joint against those of another system; ``source``: what they are computed from."""

    source: str
    angle_deg: Spread
    planes: dict[str, PlaneFigures]


class PointFigures(msgspec.Struct, frozen=True):
    """A point against another system's: its link, whether its place is fitted, and the share of frames that have it."""

    on: str
    place_fitted: bool
    seen: float
    position_cm: Spread


class AgreementFigures(msgspec.Struct, frozen=True, rename={"other": "with"}):
    """Agreement with what another system captured, see ``Agreement``; unknown ones are None, and null in the file."""

    other: str
    format: str
    states: int
    align: str
    scale: float
    unit_m: float | None
    starts_at_s: float
    starts_at_sigma_s: float
    clock_rate: float
    clock_rate_sigma: float
    doubts: list[str]
    names_left_out: list[str]
    position_cm: Spread
    position_rigid_mean_cm: float
    angle_deg: Spread | None
    points: dict[str, PointFigures]
    joints: dict[str, JointFigures]


class GaitMeasure(msgspec.Struct, frozen=True, omit_defaults=True):
    """Statistics of one measure of all strides.

    Attributes:
        left, right: means of each side.
        symmetry_percent: left less right over the mean of both (Robinson, Herzog and Nigg 1987), of measures that are
            alike on both sides; None where a side has too few strides to say it.
        symmetry_low_percent, symmetry_high_percent: its 95 % interval, by the spread of the strides (Welch 1947).
        true: mean of the truth, if there is one.
    """

    mean: float
    sd: float
    left: float
    right: float
    symmetry_percent: float | None = None
    symmetry_low_percent: float | None = None
    symmetry_high_percent: float | None = None
    true: float | None = None


class GaitFigures(msgspec.Struct, frozen=True):
    """Strides of each side, and the measures of ``gait.MEASURES``."""

    strides: dict[str, int]
    stride_s: GaitMeasure
    cadence_per_min: GaitMeasure
    stride_m: GaitMeasure
    step_m: GaitMeasure
    step_width_cm: GaitMeasure
    speed_m_s: GaitMeasure
    stance_percent: GaitMeasure
    double_support_percent: GaitMeasure
    clearance_cm: GaitMeasure
    hip_range_deg: GaitMeasure
    knee_range_deg: GaitMeasure
    ankle_range_deg: GaitMeasure


class CycleFigures(msgspec.Struct, frozen=True):
    """The flexion of one joint over the gait cycle, the mean over strides.

    Attributes:
        strides: number of them.
        peak_deg, peak_percent: most flexion, and where in the cycle.
        trough_deg, trough_percent: least flexion, and where in the cycle.
        sd_deg: standard deviation over the strides, the mean over the cycle; NaN of fewer than three.
        mean_deg: at 0, 1, ... 100 % of the cycle.
    """

    strides: int
    peak_deg: float
    peak_percent: float
    trough_deg: float
    trough_percent: float
    sd_deg: float
    mean_deg: list[float]


class SameMotion(msgspec.Struct, frozen=True):
    """How well two motions correlate, and the probability of that by chance; NaN of motions that are too short."""

    correlation: float
    by_chance: float


class VerdictFigures(msgspec.Struct, frozen=True):
    """The verdict: its level, its text, and the findings' fields as text."""

    level: str
    text: str
    findings: list[dict[str, str]]


class EvaluationFigures(msgspec.Struct, frozen=True, omit_defaults=True):
    """All figures of a solved recording.

    Attributes:
        image_coverage: share of the images with a solved state.
        gaps_s: start and end of each stretch without a solved state.
        joint_ranges_deg: angle -> its least and greatest value.
        sliding: foot, and all together -> its sliding.
        cameras, sensors, stations: by camera.
        without_equipment: distances from the equipment's points, and errors against a truth, with it and without.
        camera_centres_mm: camera -> errors of its centre against a truth that has the cameras.
        made_from: records of what the recording was solved with.
    """

    duration_s: float
    frame_s: float
    states: int
    instants_without_camera: int
    image_coverage: float
    verdict: VerdictFigures
    gaps_s: list[list[float]]
    root_position_sigma_mm: Spread
    root_rotation_sigma_deg: Spread
    jitter_mm: Spread
    sliding: dict[str, SlidingFigures]
    joint_ranges_deg: dict[str, list[float]]
    cameras: dict[str, CameraFigures]
    sensors: dict[str, SensorFigures] | None = None
    stations: dict[str, StationFigures] | None = None
    equipment: EquipmentFigures | None = None
    without_equipment: dict[str, TwoSpreads] | None = None
    truth: TruthFigures | None = None
    camera_centres_mm: dict[str, BeforeAndAfter] | None = None
    same_motion: SameMotion | None = None
    agreement: AgreementFigures | None = None
    gait: GaitFigures | None = None
    gait_cycle: dict[str, CycleFigures] | None = None
    made_from: dict[str, dict[str, str]] | None = None


def figures_text(figures: EvaluationFigures) -> str:
    """Text of ``summary.json``."""
    plain = msgspec.json.decode(msgspec.json.encode(figures, enc_hook=float))  # JSON has no NaN: null
    return json.dumps(plain, indent=1, allow_nan=False) + "\n"
