"""A solved recording with all measures of it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.evaluate import health
from bodycam_ros.evaluate.agreement import (
    Agreement,
    AgreementOptions,
    compare_with_captured,
    compare_with_truth,
    rate_same_motion,
)
from bodycam_ros.evaluate.clock_search import Clock
from bodycam_ros.evaluate.comparison import Comparison, compare
from bodycam_ros.evaluate.constraints import WithAndWithout, with_and_without
from bodycam_ros.evaluate.gait import Gait, solved_gait, true_gait
from bodycam_ros.evaluate.health import CameraHealth
from bodycam_ros.evaluate.sliding import Sliding, SlidingAgainstTruth, sliding, sliding_against_truth
from bodycam_ros.evaluate.solved_verdict import solved_verdict
from bodycam_ros.evaluate.true_motion import read_true_motion
from bodycam_ros.formats.read_captured import is_captured, read_captured
from bodycam_ros.geometry import Array
from bodycam_ros.results.solved_recording import SolvedRecording, read_solved
from bodycam_ros.verdict import Verdict


@dataclass(frozen=True, eq=False)
class Evaluation:
    """What an evaluation found, T instants, S segments.

    Attributes:
        solved: what was evaluated.
        image_coverage: share of the images with a solved instant within half a frame.
        gaps: (start, end) [s] of stretches without a solved instant.
        blind: (T,) instants without any registered camera.
        cameras: health of each.
        position_sigma: (T,) of the root [m].
        rotation_sigma: (T,) of the root [rad].
        angle_ranges: joint -> least and greatest angle [rad].
        jitter: (T, S) [m].
        sliding: foot -> how it slides while it stands.
        verdict: whether the result may be used: the one that was stored, or judged again.
        comparison: with the truth, if that was given.
        true_sliding: foot -> how it slides while the true foot stands; empty without truth.
        agreement: with what another system captured, if that was given.
        same_motion: clock of the truth or the other system, with how sure it is that the two show one motion.
        gait: how the body walks; None where it does not.
        true_gait: the same of the truth.
        constraints: beside the same recording solved without equipment, if that was given.
    """

    solved: SolvedRecording
    image_coverage: float
    gaps: tuple[tuple[float, float], ...]
    blind: NDArray[np.bool_]
    cameras: tuple[CameraHealth, ...]
    position_sigma: Array
    rotation_sigma: Array
    angle_ranges: Mapping[str, tuple[float, float]]
    jitter: Array
    sliding: Mapping[str, Sliding]
    verdict: Verdict
    comparison: Comparison | None
    true_sliding: Mapping[str, SlidingAgainstTruth]
    agreement: Agreement | None = None
    same_motion: Clock | None = None
    gait: Gait | None = None
    true_gait: Gait | None = None
    constraints: WithAndWithout | None = None

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
    without_path: Path | None = None,
) -> Evaluation:
    """Evaluate a bag that ``bodycam replay`` wrote.

    Args:
        solved_path: the bag.
        truth_path: folder of the recording, or of its truth, or what another system captured, to score against.
        recording_path: the bag with the images, whose intrinsics allow reprojection errors and checks of lenses.
        options: how that is compared as another system's motion; by default a recording's truth is not, and its clock
            is ours.
        without_path: bag of the same recording solved without the equipment.

    Raises:
        RecordingError: one of them is not what it should be, or they do not belong together.
        LensError: the recording's intrinsics cannot be used.
    """
    is_other = truth_path is not None and is_captured(truth_path)
    captured = read_captured(truth_path) if truth_path is not None and is_other else None
    truth = None if truth_path is None or is_other else read_true_motion(truth_path)
    solved = read_solved(solved_path)
    cameras = health.camera_healths(solved)
    models = {} if recording_path is None else health.camera_models(solved, recording_path)
    if models:
        reprojection = health.reprojection_errors(solved, models)
        cameras = tuple(replace(camera, reprojection=reprojection.get(camera.camera)) for camera in cameras)
    agreement = comparison = same_motion = None
    if captured is not None:
        agreement = compare_with_captured(solved, captured, options or AgreementOptions())
        same_motion = agreement.clock
    elif truth is not None:
        if options is not None:
            agreement, truth = compare_with_truth(solved, truth, options)
        comparison = compare(solved, truth)
        same_motion = rate_same_motion(solved, truth)
    constraints = None
    if without_path is not None:
        constraints = with_and_without(solved, read_solved(without_path), truth, comparison)
    position_sigma, rotation_sigma = health.root_sigmas(solved.motion.root_covariance)
    return Evaluation(
        solved=solved,
        image_coverage=health.image_coverage(solved),
        gaps=health.gaps(solved),
        blind=health.blind(solved),
        cameras=cameras,
        position_sigma=position_sigma,
        rotation_sigma=rotation_sigma,
        angle_ranges=health.angle_ranges(solved),
        jitter=health.jitter(solved),
        sliding=sliding(solved),
        verdict=solved_verdict(solved, models),
        comparison=comparison,
        true_sliding={} if comparison is None else sliding_against_truth(solved, comparison),
        agreement=agreement,
        same_motion=same_motion,
        gait=solved_gait(solved),
        constraints=constraints,
        true_gait=None if comparison is None else true_gait(solved, comparison),
    )
