"""The verdict on a solved recording: the one that its replay stored, or judged again from what its bag has."""

from collections.abc import Iterator, Mapping

import numpy as np

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.urdf import optical_frame
from bodycam_ros.camera import CameraModel
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.kinematics.joint import Joint, JointType
from bodycam_ros.quality.agreement import AgreementLog
from bodycam_ros.quality.equipment_findings import equipment_findings
from bodycam_ros.quality.judge import judge
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import PoseFitSettings
from bodycam_ros.results.solved_recording import SolvedRecording
from bodycam_ros.results.urdf_tree import UrdfTree
from bodycam_ros.verdict import Verdict

_AHEAD_NS = 200_000_000
"""Registrations that are heard before an instant's body: a camera's place then lies between two of them."""


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
    body = published_body(solved.urdf)
    log = AgreementLog(body, models, PoseFitSettings().inlier_px)
    world_T_segment = np.stack([solved.world_T_link[segment] for segment in body.segments], axis=1)
    registrations = _registrations(solved, models)
    waiting = next(registrations, None)
    for row, stamp_ns in enumerate(solved.stamps_ns.tolist()):
        while waiting is not None and waiting[1] <= stamp_ns + _AHEAD_NS:
            _add(log, *waiting)
            waiting = next(registrations, None)
        log.add_state(stamp_ns, world_T_segment[row])
    while waiting is not None:
        _add(log, *waiting)
        waiting = next(registrations, None)
    return judge(log.agreement(), body)


def published_body(urdf: UrdfTree) -> BodyModel:
    """The body that a URDF describes, as far as the places of joints and cameras go: every joint that turns is a ball.

    What slides stands beside the body, and so says nothing of it.
    """
    root_T_link = {
        link: poses[0]
        for link, poses in urdf.forward_kinematics(np.eye(4)[None], dict.fromkeys(urdf.moving, np.zeros(1))).items()
    }
    arriving = {joint.child: joint for joint in urdf.joints}
    # A robot's base link may have no shape, and so be no segment; yet all hangs on it.
    segments = urdf.segments if urdf.root in urdf.segments else (urdf.root, *urdf.segments)
    parents = dict.fromkeys(set(segments) - {urdf.root}, urdf.root) | urdf.parent_segments()
    joints = []
    for segment, parent in sorted(parents.items()):
        # The last angle on the way from the parent says where the segment turns; a welded one never does.
        way = [arriving[segment]]
        while way[-1].parent != parent:
            way.append(arriving[way[-1].parent])
        centre = next((joint.child for joint in way if joint.axis is not None), None)
        kind: JointType = "free" if any(joint.slides for joint in way) else "ball" if centre else "weld"
        root_T_joint = root_T_link[centre or segment]
        joints.append(
            Joint(
                name=f"{parent}-{segment}",
                parent=parent,
                child=segment,
                type=kind,
                parent_T_joint=inverse(root_T_link[parent]) @ root_T_joint,
                child_T_joint=inverse(root_T_link[segment]) @ root_T_joint,
            )
        )
    mounts = {}
    for camera in urdf.cameras:
        link = optical_frame(camera)
        while link not in segments and link in arriving:
            link = arriving[link].parent
        if link in segments:
            mounts[camera] = CameraMount(link, inverse(root_T_link[link]) @ root_T_link[optical_frame(camera)])
    return BodyModel("published", urdf.root, segments, tuple(joints), mounts)


_Registration = tuple[str, int, Array | None, LandmarkMatches | None]
"""Camera, stamp [ns], pose (4, 4) if it has one, and all that it said if that is wanted."""


def _registrations(solved: SolvedRecording, models: Mapping[str, CameraModel]) -> Iterator[_Registration]:
    """All registrations, in the order of time."""
    if models:
        for matches in solved.landmarks({record.camera for record in solved.cameras}):
            yield matches.camera, matches.stamp_ns, matches.world_T_camera, matches
        return
    together = [
        (int(stamp_ns), record.camera, pose)
        for record in solved.cameras
        for stamp_ns, pose in zip(record.stamps_ns, record.world_T_camera, strict=True)
    ]
    for stamp_ns, camera, pose in sorted(together, key=lambda seen: seen[:2]):
        yield camera, stamp_ns, pose if np.isfinite(pose).all() else None, None


def _add(
    log: AgreementLog, camera: str, stamp_ns: int, world_T_camera: Array | None, matches: LandmarkMatches | None
) -> None:
    if matches is not None:
        log.add_registration(matches)
    else:
        log.add_pose(camera, stamp_ns, world_T_camera)
