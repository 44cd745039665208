"""A small walking body whose motion is known; written as the bag of a replay, and as the truth of a recording."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import cv2
import numpy as np
import yaml
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, CameraMount, sole_points
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.body_state import BodyOutput, BodyState, BodyUncertainty
from bodycam_ros.camera import camera_from_info
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.geometry import exp_so3, inverse, quaternion_xyzw, rigid, transform_points
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.kinematics.joint_angles import JointAngles, JointAngleTracker
from bodycam_ros.messages.body import output_messages
from bodycam_ros.messages.diagnostics import text_message
from bodycam_ros.messages.factory import Message, header_message
from bodycam_ros.messages.tracks import landmarks_message, tracks_message
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.tracking.track_frame import TrackFrame

START_NS = 1_700_000_000_000_000_000
FRAME_NS = 33_333_333
FRAMES = 60
ROOT_SIGMA_RAD, ROOT_SIGMA_M = 1e-3, 2e-3  # per axis
LANDMARKS, TRACKS = 20, 25
LOST: dict[str, tuple[int, ...]] = {"waist": (), "shin": (10, 11, 12, 40)}
"""Camera -> frames without a pose."""

STANDS = 31
"""Frames for which ``standing`` stands."""

_SHIN_M = 0.4

PARENTS = {"torso": "pelvis", "thigh_left": "pelvis", "shin_left": "thigh_left", "foot_left": "shin_left"}

Poses = NDArray[np.float64]
Stamped = tuple[str, int, Message]


def translation(x: float, y: float, z: float) -> Poses:
    return rigid(np.eye(3), np.array([x, y, z]))


@dataclass(frozen=True)
class Walk:
    """A motion: its body, stamps (T,) and poses of all segments (T, S, 4, 4)."""

    body: BodyModel
    stamps_ns: NDArray[np.int64]
    world_T_segment: Poses

    def moved(self, world_T_map: Poses) -> "Walk":
        return replace(self, world_T_segment=world_T_map @ self.world_T_segment)

    def without(self, frames: list[int]) -> "Walk":
        kept = np.setdiff1d(np.arange(len(self.stamps_ns)), frames)
        return replace(self, stamps_ns=self.stamps_ns[kept], world_T_segment=self.world_T_segment[kept])

    def bent(self, joint: str, degrees: NDArray[np.float64]) -> "Walk":
        """A hinge or the first axis of a ball turned by more (T,); what hangs on it moves along."""
        joint_poses = self.body.joint_poses(self.world_T_segment)
        row = [j.name for j in self.body.tree_joints].index(joint)
        turn = exp_so3(np.radians(degrees)[:, None] * np.array([0.0, 1.0, 0.0]))
        joint_poses[:, row, :3, :3] = joint_poses[:, row, :3, :3] @ turn
        root = self.world_T_segment[:, self.body.segment_index[self.body.root]]
        return replace(self, world_T_segment=self.body.forward_kinematics(root, joint_poses))


def walking_body() -> BodyModel:
    """Pelvis, torso and a left leg, with a camera on the pelvis and one on the shin."""
    looking_left = rigid(np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]]), np.array([0.0, 0.1, -0.2]))
    return BodyModel(
        name="walker",
        root="pelvis",
        segments=("pelvis", *PARENTS),
        joints=(
            Joint("spine", "pelvis", "torso", "ball", translation(0.0, 0.0, 0.1)),
            Joint("hip_left", "pelvis", "thigh_left", "ball", translation(0.0, 0.1, 0.0)),
            Joint(
                "knee_left", "thigh_left", "shin_left", "hinge", translation(0.0, 0.0, -0.4),
                axis=np.array([0.0, 1.0, 0.0]),
            ),
            Joint("ankle_left", "shin_left", "foot_left", "ball", translation(0.0, 0.0, -0.4), angle_axes="yxz"),
        ),
        mounts={"waist": CameraMount("pelvis", looking_left), "shin": CameraMount("shin_left", looking_left)},
    )  # fmt: skip


def make_walk() -> Walk:
    """Two seconds of walking: smooth, three metres long, every joint in motion."""
    body = walking_body()
    stamps_ns = START_NS + FRAME_NS * np.arange(FRAMES, dtype=np.int64)
    phase = np.linspace(0.0, 4.0, FRAMES)
    amplitude = {
        "spine_y": 0.1,
        "spine_z": 0.2,
        "hip_left_y": 0.5,
        "hip_left_x": 0.1,
        "knee_left": 0.4,
        "ankle_left_y": 0.2,
    }
    names = JointAngles(body).names
    angles = np.stack([amplitude.get(name, 0.05) * np.sin(phase + column) for column, name in enumerate(names)], axis=1)
    angles[:, names.index("knee_left")] += 0.6
    turned = exp_so3(np.column_stack([0.05 * np.sin(phase), 0.05 * np.cos(phase), 0.3 * phase]))
    root = rigid(turned, np.column_stack([0.75 * phase, 0.2 * np.sin(phase), 1.0 + 0.02 * np.cos(2.0 * phase)]))
    return Walk(body, stamps_ns, body.forward_kinematics(root, JointAngles(body).rotations(angles)))


def write_truth(walk: Walk, folder: Path) -> Path:
    """Write the folder of a recording with the truth of a walk."""
    (folder / "truth" / "segments").mkdir(parents=True)
    (folder / "rig.yaml").write_text(yaml.safe_dump({"segments": {"pelvis": None, **PARENTS}}))
    for row, segment in enumerate(("pelvis", *PARENTS)):
        lines = ["# time x y z qx qy qz qw"]
        for stamp_ns, pose in zip(walk.stamps_ns.tolist(), walk.world_T_segment[:, row], strict=True):
            numbers = [*pose[:3, 3], *quaternion_xyzw(pose[:3, :3])]
            lines.append(" ".join([f"{stamp_ns // 10**9}.{stamp_ns % 10**9:09d}", *map(repr, map(float, numbers))]))
        (folder / "truth" / "segments" / f"{segment}.tum").write_text("\n".join(lines) + "\n")
    return folder


def write_solved(
    walk: Walk,
    path: Path,
    *,
    published: BodyModel | None = None,
    pixel_noise: float = 0.0,
    leave_out: tuple[str, ...] = (),
    more: Sequence[Stamped] = (),
    clocks_ns: Mapping[str, int] = MappingProxyType({}),
) -> Path:
    """Write the bag that a replay would, for a walk.

    Args:
        published: the body of the URDF, if not the walk's own.
        pixel_noise: standard deviation of where landmarks are seen [px].
        leave_out: topics.
        more: messages to append.
        clocks_ns: camera -> by how much its stamps are ahead [ns].
    """
    description = text_message(recorded_messages(), urdf_text(published or walk.body))
    messages = [
        ("/robot_description", START_NS, description),
        *_body_messages(walk),
        *_camera_messages(walk, pixel_noise, clocks_ns),
    ]
    kept = sorted((m for m in messages if m[0] not in leave_out), key=lambda m: m[1])
    with write_recording(path) as writer:
        for topic, stamp_ns, message in [*kept, *more]:
            writer.write(topic, stamp_ns, message)
    return path


def write_images(path: Path, cameras: tuple[str, ...], begin_ns: int = START_NS) -> Path:
    """Write a recording of these cameras: intrinsics, and plain grey images."""
    make = recorded_messages()
    grey = cv2.imencode(".jpg", np.full((480, 640), 90, np.uint8))[1].reshape(-1)
    with write_recording(path) as writer:
        for camera in cameras:
            header = header_message(make, START_NS, optical_frame(camera))
            k = np.array([FOCAL, 0.0, 319.5, 0.0, FOCAL, 239.5, 0.0, 0.0, 1.0])
            info = make(
                "sensor_msgs/msg/CameraInfo", header=header, width=640, height=480,
                distortion_model="equidistant", d=np.zeros(4), k=k,
            )  # fmt: skip
            writer.write(f"/{camera}/camera_info", START_NS, info)
            for stamp_ns in range(begin_ns, begin_ns + FRAMES * FRAME_NS, FRAME_NS):
                header = header_message(make, stamp_ns, optical_frame(camera))
                image = make("sensor_msgs/msg/CompressedImage", header=header, format="jpeg", data=grey)
                writer.write(f"/{camera}/image_raw/compressed", stamp_ns, image)
    return path


FOCAL = 240.0
_MODEL = camera_from_info("any", 640, 480, "equidistant", [0.0] * 4, [FOCAL, 0, 319.5, 0, FOCAL, 239.5, 0, 0, 1])


def _body_messages(walk: Walk) -> list[Stamped]:
    messages = []
    tracker = JointAngleTracker(walk.body)
    covariance = np.diag([ROOT_SIGMA_RAD**2] * 3 + [ROOT_SIGMA_M**2] * 3)
    for stamp_ns, poses in zip(walk.stamps_ns.tolist(), walk.world_T_segment, strict=True):
        joints = np.tile(1e-4 * np.eye(3), (len(walk.body.tree_joints), 1, 1))
        count = len(walk.body.segments)
        known = BodyUncertainty(covariance, covariance, joints, np.tile(covariance, (count, 1, 1)))
        seen = np.ones(count, bool)
        state = BodyState(stamp_ns, walk.body.segments, poses, np.zeros((count, 6)), known, seen, cameras_used=2)
        angles = tracker.angles(poses)
        output = BodyOutput(state, tracker.names, angles, np.zeros(len(angles)))
        topics = output_messages(recorded_messages(), output, walk.body)
        messages += [(topic, stamp_ns, message) for topic, message in topics.items()]
    return messages


def _camera_messages(walk: Walk, pixel_noise: float, clocks_ns: Mapping[str, int]) -> list[Stamped]:
    """Images come at the whole recording's rate, whether or not they were solved."""
    messages: list[Stamped] = []
    random = np.random.default_rng(3)
    poses_at = dict(zip(walk.stamps_ns.tolist(), walk.world_T_segment, strict=True))
    for frame in range(FRAMES):
        stamp_ns = START_NS + frame * FRAME_NS
        poses = poses_at.get(stamp_ns, walk.world_T_segment[0])
        for camera, mount in walk.body.mounts.items():
            world_T_camera = poses[walk.body.segment_index[mount.segment]] @ mount.segment_T_camera
            known = frame not in LOST.get(camera, ())
            given_ns = stamp_ns + clocks_ns.get(camera, 0)
            matches = _matches(camera, given_ns, world_T_camera, known, random, pixel_noise)
            tracks = tracks_message(recorded_messages(), _tracks(camera, given_ns))
            messages.append((f"/{camera}/tracks", given_ns, tracks))
            messages.append((f"/{camera}/landmarks", given_ns, landmarks_message(recorded_messages(), matches)))
    return messages


def _tracks(camera: str, stamp_ns: int) -> TrackFrame:
    return TrackFrame(
        camera=camera,
        stamp_ns=stamp_ns,
        previous_stamp_ns=0,
        track_ids=np.arange(TRACKS, dtype=np.uint32),
        pixels=np.zeros((TRACKS, 2), np.float32),
        current_R_previous=np.eye(3),
        rotation_inliers=0,
    )


def _matches(
    camera: str, stamp_ns: int, world_T_camera: Poses, known: bool, random: np.random.Generator, pixel_noise: float
) -> LandmarkMatches:
    count = LANDMARKS if known else 0
    points_camera = random.uniform([-1.0, -1.0, 2.0], [1.0, 1.0, 4.0], size=(count, 3))
    points_world = transform_points(world_T_camera, points_camera).astype(np.float32)
    pixels, _ = _MODEL.project(transform_points(inverse(world_T_camera), points_world.astype(np.float64)))
    pixels = pixels + pixel_noise * random.normal(size=pixels.shape)
    ids = np.arange(count, dtype=np.uint32)
    return LandmarkMatches(
        camera, stamp_ns, 0, ids, ids, pixels.astype(np.float32), points_world, world_T_camera if known else None,
        np.eye(6), np.eye(3), 0,
    )  # fmt: skip


def standing(speed: float, height: float = 0.0) -> Walk:
    """A body that stands for a second, at a speed all the same, and then glides away at 1 m/s."""
    body = walking_body()
    seconds = 1e-9 * FRAME_NS * np.arange(FRAMES)
    stands = seconds[STANDS - 1]
    x = speed * np.minimum(seconds, stands) + np.maximum(seconds - stands, 0.0)
    ankle_to_sole = -sole_points(_SHIN_M)[0, 2]
    root = np.column_stack([0.6 * x, 0.8 * x, np.full(FRAMES, 2 * _SHIN_M + ankle_to_sole + height)])
    poses = rigid(np.tile(np.eye(3), (FRAMES, 1, 1)), root)
    still: Poses = np.tile(np.eye(3), (FRAMES, len(body.tree_joints), 1, 1))
    return Walk(body, START_NS + FRAME_NS * np.arange(FRAMES, dtype=np.int64), body.forward_kinematics(poses, still))
