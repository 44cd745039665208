"""A solved recording with all measures of it."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.evaluate import camera_figures
from bodycam_ros.evaluate.agreement import (
    Agreement,
    AgreementOptions,
    compare_with_captured,
    rate_same_motion,
)
from bodycam_ros.evaluate.angle_panels import cycle_figures, solved_cycles
from bodycam_ros.evaluate.camera_centres import CentreErrors, centre_errors
from bodycam_ros.evaluate.comparison import Comparison, compare, read_true_motion
from bodycam_ros.evaluate.equipment import equipment_figures
from bodycam_ros.evaluate.figures import EvaluationFigures, SameMotion, VerdictFigures, spread
from bodycam_ros.evaluate.gait import solved_gait, solved_strides
from bodycam_ros.evaluate.gait_cycle import CycleAngle
from bodycam_ros.evaluate.normal_angles import NormalAngles, read_normal_angles
from bodycam_ros.evaluate.sliding import sliding_figures
from bodycam_ros.evaluate.with_and_without import WithAndWithout, with_and_without
from bodycam_ros.formats.read_captured import is_captured, read_captured
from bodycam_ros.geometry import Array
from bodycam_ros.quality.camera_poses import CameraPoseLog
from bodycam_ros.quality.equipment_findings import equipment_findings
from bodycam_ros.quality.judge import judge
from bodycam_ros.quality.sensor_checks import MIN_SAMPLES
from bodycam_ros.recording.imu_reader import read_imus
from bodycam_ros.recording.time_span import TimeSpan
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.results.provenance import Provenance, check_same_inputs
from bodycam_ros.results.solved_part import part_of
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved
from bodycam_ros.results.verdict import Verdict, finding_record

_LATER_NS = 200_000_000
"""A state is added this much after its time: the pose of a camera then lies between two registrations."""

_WHOLE = TimeSpan()


@dataclass(frozen=True, eq=False)
class Evaluation:
    """Figures of a solved recording, and the curves that its pictures show, over T states.

    Attributes:
        solved: the recording.
        verdict: whether the result may be used: the stored one, or that of its bag.
        figures: content of ``summary.json``.
        blind: (T,) states without any registered camera.
        position_sigma: (T,) of the root [m].
        jitter: (T, S) [m].
        comparison: with the truth, if that was given.
        agreement: with what another system captured, if that was given.
        gyroscopes: camera -> its gyroscope against its solved camera, of calibrated sensors.
        made_from: what the recording was solved with.
        cycles: (joint, side) -> its angle over the gait cycle, where the body walks.
        normal: angles of healthy people, if they were given.
        centres: camera -> errors of its centre before and after the optimisation, where the truth has the cameras.
        constraints: what the equipment changes, where the recording was solved without it too.
    """

    solved: SolvedRecording
    verdict: Verdict
    figures: EvaluationFigures
    blind: NDArray[np.bool_]
    position_sigma: Array
    jitter: Array
    comparison: Comparison | None
    agreement: Agreement | None
    gyroscopes: Mapping[str, camera_figures.GyroscopeResiduals]
    made_from: Provenance
    cycles: Mapping[tuple[str, str], CycleAngle] = field(default_factory=dict)
    normal: NormalAngles | None = None
    constraints: WithAndWithout | None = None
    centres: Mapping[str, CentreErrors] = field(default_factory=dict)

    @property
    def truth_name(self) -> str:
        """Name of the truth or of what another system captured; empty without either."""
        if self.comparison is not None:
            return self.comparison.truth_name
        return "" if self.agreement is None else self.agreement.name


def evaluate(
    solved_path: Path,
    truth_path: Path | None = None,
    recording_path: Path | None = None,
    options: AgreementOptions | None = None,
    imu_paths: Sequence[Path] = (),
    span: TimeSpan = _WHOLE,
    normal_path: Path | None = None,
    without_path: Path | None = None,
) -> Evaluation:
    """Evaluate a bag that ``bodycam replay`` wrote.

    Args:
        solved_path: the bag.
        truth_path: folder of the recording, or of its truth, or what another system captured, to score against.
        recording_path: the bag with the images, whose intrinsics allow reprojection errors and checks of lenses.
        options: how what another system captured is compared; the clock of a recording's truth is ours.
        imu_paths: bags with the inertial sensors, beside the recording.
        span: the part of the recording that is evaluated.
        normal_path: table of the normal angles of joints over the gait cycle, see ``normal_angles``.
        without_path: the same recording solved without the equipment that this one was solved with.

    Raises:
        RecordingError: one of them is not what it should be, or they do not belong together.
        LensError: the recording's intrinsics cannot be used.
    """
    is_other = truth_path is not None and is_captured(truth_path)
    normal = None if normal_path is None else read_normal_angles(normal_path)
    captured = read_captured(truth_path) if truth_path is not None and is_other else None
    truth = None if truth_path is None or is_other else read_true_motion(truth_path)
    solved, made_from = part_of(read_solved(solved_path), span), Provenance.read(solved_path)
    models = {} if recording_path is None else camera_figures.camera_models(solved, recording_path)
    agreement = comparison = same_motion = None
    if captured is not None:
        agreement = compare_with_captured(solved, captured, options or AgreementOptions())
        same_motion = agreement.clock
    elif truth is not None:
        comparison = compare(solved, truth)
        same_motion = rate_same_motion(solved, truth)
    centres = {} if truth is None else centre_errors(solved, truth.path)
    constraints = None
    if without_path is not None:
        check_same_inputs(made_from, Provenance.read(without_path))
        constraints = with_and_without(solved, part_of(read_solved(without_path), span), truth, comparison)
    verdict = solved_verdict(solved, models)
    blind = camera_figures.blind(solved)
    jitter = camera_figures.jitter(solved)
    variances = np.diagonal(solved.root_covariance, axis1=1, axis2=2)
    rotation_sigma, position_sigma = (np.sqrt(variances[:, rows].sum(axis=1)) for rows in (slice(0, 3), slice(3, 6)))
    cameras = camera_figures.camera_figures(solved, models)
    bags = (*([] if recording_path is None else [recording_path]), *imu_paths)
    sensors = {name: s for name, s in read_imus(bags, cameras).items() if len(s) >= MIN_SAMPLES}
    gyroscopes = camera_figures.gyroscope_residuals(solved, sensors)
    strides = solved_strides(solved)
    cycles = solved_cycles(solved, strides)
    figures = EvaluationFigures(
        duration_s=solved.duration_s,
        frame_s=1e-9 * solved.frame_ns,
        states=len(solved.stamps_ns),
        instants_without_camera=int(blind.sum()),
        image_coverage=camera_figures.image_coverage(solved),
        verdict=VerdictFigures(verdict.level.word, verdict.text, [*map(finding_record, verdict.findings)]),
        gaps_s=camera_figures.gaps(solved),
        root_position_sigma_mm=spread(position_sigma, 1e3),
        root_rotation_sigma_deg=spread(rotation_sigma, np.degrees(1.0)),
        jitter_mm=spread(jitter, 1e3),
        sliding=sliding_figures(solved, comparison),
        joint_ranges_deg=camera_figures.angle_ranges_deg(solved),
        cameras=cameras,
        sensors=camera_figures.sensor_figures(sensors, gyroscopes) or None,
        stations={record.station: camera_figures.static_camera_figures(record) for record in solved.stations} or None,
        equipment=equipment_figures(solved.equipment, solved.start_ns) if solved.equipment else None,
        without_equipment=constraints.figures() if constraints else None,
        truth=comparison.figures() if comparison else None,
        camera_centres_mm={camera: each.figures() for camera, each in centres.items()} or None,
        same_motion=SameMotion(same_motion.likeness, same_motion.chance) if same_motion else None,
        agreement=agreement.figures() if agreement else None,
        gait=solved_gait(solved, strides, comparison),
        gait_cycle=cycle_figures(cycles) or None,
        made_from=made_from.sources or None,
    )
    curves = blind, position_sigma, jitter
    return Evaluation(
        solved,
        verdict,
        figures,
        *curves,
        comparison,
        agreement,
        gyroscopes,
        made_from,
        cycles,
        normal,
        constraints,
        centres,
    )


def solved_verdict(solved: SolvedRecording, models: Mapping[str, CameraModel]) -> Verdict:
    """The stored verdict; judged from the bag where none is stored, as in one of the live graph.

    Args:
        solved: the recording.
        models: camera -> its model, to check lenses by landmarks; those of other cameras are not checked.

    Raises:
        RecordingError: the bag is damaged.
    """
    if solved.stored_verdict is not None:
        return solved.stored_verdict
    log = CameraPoseLog(solved.body, models, PoseFitSettings().inlier_px)
    added, stamps_ns = 0, solved.stamps_ns.tolist()
    for matches in solved.landmarks({record.camera for record in solved.cameras}):
        while added < len(stamps_ns) and stamps_ns[added] + _LATER_NS < matches.stamp_ns:
            log.add_state(stamps_ns[added], solved.world_T_segment[added])
            added += 1
        log.add_registration(matches)
    for row in range(added, len(stamps_ns)):
        log.add_state(stamps_ns[row], solved.world_T_segment[row])
    return judge(log.poses(), equipment_findings(solved.equipment))
