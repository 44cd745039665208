"""The verdict on a solved recording: the one that its replay stored, or judged again from what its bag has."""

import heapq
from collections.abc import Callable, Iterator, Mapping
from dataclasses import replace
from functools import partial
from operator import itemgetter

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.quality.camera_poses import CameraPoseLog
from bodycam_ros.quality.equipment_findings import equipment_findings
from bodycam_ros.quality.judge import judge
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.verdict import Verdict

_AHEAD_NS = 200_000_000
"""Registrations are added this much before a frame's body: a camera's pose then lies between two of them."""

_Event = tuple[int, int, Callable[[], None]]
"""Time from which on it counts [ns], 0 of registrations and 1 of states, and what adds it to the log."""


def solved_verdict(solved: SolvedRecording, models: Mapping[str, CameraModel]) -> Verdict:
    """The stored verdict; judged from the bag where none is stored, as in one of the live graph.

    Args:
        solved: the recording.
        models: camera -> its model, for what landmarks show of the lens; without them that stays unknown.

    Raises:
        RecordingError: the bag is damaged.
    """
    if solved.stored_verdict is not None:
        return solved.stored_verdict
    return Verdict.from_findings((*_judge_cameras(solved, models).findings, *equipment_findings(solved.equipment)))


def _judge_cameras(solved: SolvedRecording, models: Mapping[str, CameraModel]) -> Verdict:
    body = solved.body
    body = replace(body, joints=body.tree_joints)  # what closes loops is of the equipment
    log = CameraPoseLog(body, models, PoseFitSettings().inlier_px)
    world_T_segment = np.stack([solved.world_T_link[segment] for segment in body.segments], axis=1)
    states: Iterator[_Event] = (
        (stamp_ns, 1, partial(log.add_state, stamp_ns, poses))
        for stamp_ns, poses in zip(solved.stamps_ns.tolist(), world_T_segment, strict=True)
    )
    for _, _, add in heapq.merge(_registrations(solved, models, log), states, key=itemgetter(0, 1)):
        add()
    return judge(log.poses())


def _registrations(solved: SolvedRecording, models: Mapping[str, CameraModel], log: CameraPoseLog) -> Iterator[_Event]:
    """Registrations, in the order of time."""
    if models:
        for matches in solved.landmarks({record.camera for record in solved.cameras}):
            yield matches.stamp_ns - _AHEAD_NS, 0, partial(log.add_registration, matches)
        return
    together = [
        (int(stamp_ns), record.camera, pose)
        for record in solved.cameras
        for stamp_ns, pose in zip(record.stamps_ns, record.world_T_camera, strict=True)
    ]
    for stamp_ns, camera, pose in sorted(together, key=itemgetter(0, 1)):
        known = pose if np.isfinite(pose).all() else None
        yield stamp_ns - _AHEAD_NS, 0, partial(log.add_pose, camera, stamp_ns, known)
