"""The gait of a solved recording, and that of its truth."""

import numpy as np

from bodycam_ros.evaluate.comparison import Comparison
from bodycam_ros.evaluate.sliding import feet_of, sole_of
from bodycam_ros.evaluate.walking.gait import Gait, gait
from bodycam_ros.solved.solved_recording import SolvedRecording


def solved_gait(solved: SolvedRecording) -> Gait | None:
    """How the body walks as it was solved; None where it does not."""
    soles = {foot.removeprefix("foot_"): sole_of(solved, foot, solved.world_T_link[foot]) for foot in feet_of(solved)}
    segments = {segment: solved.world_T_link[segment] for segment in solved.urdf.body_segments}
    return gait(solved.seconds(solved.stamps_ns), segments, soles, 1e-9 * solved.longest_step_ns)


def true_gait(solved: SolvedRecording, comparison: Comparison) -> Gait | None:
    """How it truly walks, by feet of the same size; None where it does not."""
    segments = dict(zip(comparison.segments, comparison.true_segments, strict=True))
    soles = {
        foot.removeprefix("foot_"): sole_of(solved, foot, segments[foot])
        for foot in feet_of(solved)
        if foot in segments
    }
    seconds = np.asarray(solved.seconds(comparison.stamps_ns))
    return gait(seconds, segments, soles, 1e-9 * solved.longest_step_ns)
