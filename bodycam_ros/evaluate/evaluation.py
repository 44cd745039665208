"""A solved recording with all that can be said about it."""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.evaluate import health
from bodycam_ros.evaluate.agree import AgreementOptions, agree
from bodycam_ros.evaluate.agreement import Agreement
from bodycam_ros.evaluate.brightness import Brightness, brightness
from bodycam_ros.evaluate.comparison import Comparison
from bodycam_ros.evaluate.gait import Gait, solved_gait, true_gait
from bodycam_ros.evaluate.health import CameraHealth
from bodycam_ros.evaluate.held_points import WithAndWithout, with_and_without
from bodycam_ros.evaluate.sliding import Sliding, SlidingAgainstTruth, sliding, sliding_against_truth
from bodycam_ros.evaluate.solved_verdict import solved_verdict
from bodycam_ros.evaluate.true_motion import read_true_motion
from bodycam_ros.evaluate.truth_as_captured import compare_with_truth
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
        brightness: camera -> its brightness over time; empty unless the recording was given.
        verdict: whether the result may be used: the one that was stored, or judged again.
        comparison: with the truth, if that was given.
        true_sliding: foot -> how it slides while the true foot stands; empty without truth.
        agreement: with the truth, or with what another system captured, if that was given.
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
    brightness: Mapping[str, Brightness]
    verdict: Verdict
    comparison: Comparison | None
    true_sliding: Mapping[str, SlidingAgainstTruth]
    agreement: Agreement | None = None
    gait: Gait | None = None
    true_gait: Gait | None = None
    constraints: WithAndWithout | None = None


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
        recording_path: the bag with the images, whose intrinsics allow reprojection errors and a look at the lenses,
            and which shows how bright it was.
        options: how that is compared; by default by a similarity, and by the same clock if it is a recording's truth.
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
    agreement = comparison = None
    if captured is not None:
        agreement = agree(solved, captured, options or AgreementOptions())
    elif truth is not None:
        options = options or AgreementOptions(shares_clock=True)
        comparison, agreement, truth = compare_with_truth(solved, truth, options)
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
        brightness={} if recording_path is None else brightness(solved, recording_path),
        verdict=solved_verdict(solved, models),
        comparison=comparison,
        true_sliding={} if comparison is None else sliding_against_truth(solved, comparison),
        agreement=agreement,
        gait=solved_gait(solved),
        constraints=constraints,
        true_gait=None if comparison is None else true_gait(solved, comparison),
    )
