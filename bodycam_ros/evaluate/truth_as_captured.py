"""The truth of a recording, compared as any other system's motion is."""

from dataclasses import replace

import numpy as np

from bodycam_ros.body.urdf import optical_frame
from bodycam_ros.evaluate.agree import AgreementOptions, agree
from bodycam_ros.evaluate.agreement import Agreement
from bodycam_ros.evaluate.alignment import Tracked, rate_shared_clock
from bodycam_ros.evaluate.clock_search import Clock
from bodycam_ros.evaluate.true_motion import TrueMotion, read_true_camera
from bodycam_ros.formats.captured_motion import CapturedMotion
from bodycam_ros.formats.point_sites import PointSite
from bodycam_ros.results.solved_recording import SolvedRecording


def agree_with_truth(
    solved: SolvedRecording, truth: TrueMotion, options: AgreementOptions
) -> tuple[Agreement, TrueMotion]:
    """Compare with a recording's truth as with any other system; also the truth with stamps of our clock.

    Raises:
        RecordingError: they share no time or too few segments, or the truth's cameras are malformed.
    """
    poses = dict(truth.world_T_segment)
    for camera in solved.urdf.cameras:
        if (of_camera := read_true_camera(truth, camera)) is not None:
            poses[optical_frame(camera)] = of_camera
    points = {name: np.ascontiguousarray(of[:, :3, 3]) for name, of in poses.items()}
    rotations = {name: np.ascontiguousarray(poses[name][:, :3, :3]) for name in truth.world_T_segment}
    captured = CapturedMotion(truth.path, "truth", truth.stamps_ns, points, rotations)
    agreement = replace(agree(solved, captured, options), name=truth.recording)
    if options.shares_clock:
        return agreement, truth
    start_ns = solved.start_ns + round(1e9 * agreement.clock.start_s)
    since_ns = np.rint(agreement.clock.rate * (truth.stamps_ns - truth.stamps_ns[0])).astype(np.int64)
    return agreement, replace(truth, stamps_ns=start_ns + since_ns)


def rate_same_motion(solved: SolvedRecording, truth: TrueMotion) -> Clock:
    """How sure it is that a truth by our clock is of this motion.

    Raises:
        RecordingError: they agree no better than at other offsets in time.
    """
    segments = [segment for segment in solved.urdf.segments if segment in truth.world_T_segment]
    points = {segment: np.ascontiguousarray(truth.world_T_segment[segment][:, :3, 3]) for segment in segments}
    captured = CapturedMotion(truth.path, "truth", truth.stamps_ns, points)
    links = {segment: solved.world_T_link[segment] for segment in segments}
    places = {segment: PointSite(segment, np.zeros(3)) for segment in segments}
    tracked = Tracked(solved.seconds(solved.stamps_ns), links, places)
    return rate_shared_clock(tracked, captured, Clock(1e-9 * float(truth.stamps_ns[0] - solved.start_ns)))
