"""The verdict on a solved recording: the one that its replay stored, or judged again from what its bag has."""

from collections.abc import Mapping

from bodycam_ros.camera import CameraModel
from bodycam_ros.quality.camera_poses import CameraPoseLog
from bodycam_ros.quality.equipment_findings import equipment_findings
from bodycam_ros.quality.judge import judge
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.verdict import Verdict

_LATER_NS = 200_000_000
"""A state is added this much after its time: the pose of a camera then lies between two registrations."""


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
    return Verdict.from_findings((*judge(log.poses()).findings, *equipment_findings(solved.equipment)))
