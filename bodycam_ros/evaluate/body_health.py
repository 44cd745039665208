"""What a solved recording says about its body, without any truth."""

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.evaluate.measures import distance_in_time
from bodycam_ros.geometry import Array
from bodycam_ros.solved.solved_recording import GAP_FRAMES, SolvedRecording

_FOURTH_DIFFERENCE = np.array([1.0, -4.0, 6.0, -4.0, 1.0])
_EVEN_SHARE = 0.2
"""Steps in time count as even if they differ from the frame's by no more than this share."""


def image_stamps(solved: SolvedRecording) -> NDArray[np.int64]:
    """Stamps of all cameras' images, sorted [ns]."""
    stamps: NDArray[np.int64] = np.sort(np.concatenate([record.stamps_ns for record in solved.cameras]))
    return stamps


def image_coverage(solved: SolvedRecording) -> float:
    """Share of the images with a solved instant within half a frame."""
    return float(np.mean(distance_in_time(image_stamps(solved), solved.stamps_ns) <= solved.frame_ns / 2.0))


def gaps(solved: SolvedRecording) -> tuple[tuple[float, float], ...]:
    """(start, end) [s] of each stretch of the recording without a solved instant, both ends included."""
    images = image_stamps(solved)
    one_frame = solved.frame_ns
    # As if an instant were solved a frame before the first image and a frame after the last.
    edges = np.concatenate([[images[0] - one_frame], solved.stamps_ns, [images[-1] + one_frame]])
    wide = np.flatnonzero(np.diff(edges) > GAP_FRAMES * one_frame)
    starts, ends = solved.seconds(edges[wide] + one_frame), solved.seconds(edges[wide + 1] - one_frame)
    return tuple(zip(starts.tolist(), ends.tolist(), strict=True))


def blind(solved: SolvedRecording) -> NDArray[np.bool_]:
    """(T,) instants that no registered camera speaks about: the body follows from motion alone."""
    seen = np.concatenate([record.stamps_ns[record.registered] for record in solved.cameras])
    if not len(seen):
        return np.ones(len(solved.stamps_ns), dtype=bool)
    nothing_near: NDArray[np.bool_] = distance_in_time(solved.stamps_ns, np.sort(seen)) > solved.frame_ns / 2.0
    return nothing_near


def root_sigmas(root_covariance: Array) -> tuple[Array, Array]:
    """Standard deviations (T,) of the root's position [m] and rotation [rad]: square roots of the blocks' traces."""
    variances = np.diagonal(root_covariance, axis1=1, axis2=2)
    return np.sqrt(variances[:, 3:].sum(axis=1)), np.sqrt(variances[:, :3].sum(axis=1))


def angle_ranges(solved: SolvedRecording) -> dict[str, tuple[float, float]]:
    """Joint -> the least and the greatest of its angles [rad]."""
    angles = solved.motion.joint_angles
    ends = zip(angles.min(axis=0).tolist(), angles.max(axis=0).tolist(), strict=True)
    return dict(zip(solved.motion.joint_names, ends, strict=True))


def jitter(solved: SolvedRecording) -> Array:
    """Noise (T, S) of the segments' origins [m]: the fourth difference over time, divided by sqrt(70).

    For white noise its mean square is the noise's own, over three axes; a motion up to the third order in time leaves
    nothing. NaN at the ends and beside gaps.
    """
    origins = np.stack([solved.world_T_link[segment][:, :3, 3] for segment in solved.urdf.segments], axis=1)
    noise = np.full(origins.shape[:2], np.nan)
    width = len(_FOURTH_DIFFERENCE)
    if len(origins) < width:
        return noise
    windows = np.lib.stride_tricks.sliding_window_view(origins, width, axis=0)
    differences = np.linalg.norm(windows @ _FOURTH_DIFFERENCE, axis=-1) / np.linalg.norm(_FOURTH_DIFFERENCE)
    even = np.abs(np.diff(solved.stamps_ns) - solved.frame_ns) <= _EVEN_SHARE * solved.frame_ns
    all_even = np.asarray(np.lib.stride_tricks.sliding_window_view(even, width - 1).all(axis=-1), dtype=np.bool_)
    noise[width // 2 : -(width // 2)] = np.where(all_even[:, None], differences, np.nan)
    return noise
