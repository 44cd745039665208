"""The truth of a recording, compared as any other system's motion is."""

from dataclasses import replace

import numpy as np

from bodycam_ros.body.urdf import optical_frame
from bodycam_ros.evaluate.agree import AgreementOptions, agree
from bodycam_ros.evaluate.agreement import Agreement
from bodycam_ros.evaluate.comparison import Comparison, compare
from bodycam_ros.evaluate.true_motion import TrueMotion, read_true_camera
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.results.solved_recording import SolvedRecording


def compare_with_truth(
    solved: SolvedRecording, truth: TrueMotion, options: AgreementOptions
) -> tuple[Comparison, Agreement, TrueMotion]:
    """Compare with a recording's truth by our measures, and as any other system is; by one clock in both.

    Returns:
        Both, and the truth with the stamps of our clock.

    Raises:
        RecordingError: they share no time or too few segments, or the truth's cameras are malformed.
    """
    comparison = compare(solved, truth) if options.shares_clock else None
    captured = _captured(solved, truth)
    agreement = replace(agree(solved, captured, options), name=truth.recording)
    if comparison is not None:
        return comparison, agreement, truth
    start_ns = solved.start_ns + round(1e9 * agreement.clock.start_s)
    since_ns = np.rint(agreement.clock.rate * (truth.stamps_ns - truth.stamps_ns[0])).astype(np.int64)
    truth = replace(truth, stamps_ns=start_ns + since_ns)
    return compare(solved, truth), agreement, truth


def _captured(solved: SolvedRecording, truth: TrueMotion) -> CapturedMotion:
    poses = dict(truth.world_T_segment)
    for camera in solved.urdf.cameras:
        if (of_camera := read_true_camera(truth, camera)) is not None:
            poses[optical_frame(camera)] = of_camera
    points = {name: np.ascontiguousarray(of[:, :3, 3]) for name, of in poses.items()}
    rotations = {name: np.ascontiguousarray(poses[name][:, :3, :3]) for name in truth.world_T_segment}
    return CapturedMotion(truth.path, "truth", truth.stamps_ns, points, rotations)
