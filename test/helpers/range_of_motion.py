"""A body of which everything is known, doing its range of motion before known cameras and landmarks."""

from collections.abc import Collection, Iterator, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.geometry import exp_so3, inverse, rigid
from bodycam_ros.kinematics.joint import Joint
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.pose_fit import PoseFitSettings, fit_pose

Array = NDArray[np.float64]

START_NS = 5_000_000_000
STILL_S = 1.5
HINGES = ("elbow_left", "knee_left")
_SEEN = 50
_TRACK_S = 0.6

_JOINTS = {
    "spine": ("pelvis", "torso", (-0.01, 0.0, 0.1)),
    "shoulder_left": ("torso", "upper_arm_left", (0.0, 0.2, 0.38)),
    "elbow_left": ("upper_arm_left", "forearm_left", (0.0, 0.0, -0.28)),
    "hip_left": ("pelvis", "thigh_left", (0.0, 0.09, 0.0)),
    "hip_right": ("pelvis", "thigh_right", (0.0, -0.09, 0.0)),
    "knee_left": ("thigh_left", "shin_left", (0.0, 0.0, -0.42)),
    "ankle_left": ("shin_left", "foot_left", (0.0, 0.0, -0.43)),
}
_CAMERAS = {
    "waist_front": ("pelvis", (0.14, 0.0, 0.04), 0.0),
    "waist_left": ("pelvis", (-0.1, 0.15, 0.05), 2.0),
    "waist_right": ("pelvis", (-0.1, -0.15, 0.03), -2.0),
    "chest": ("torso", (0.14, 0.0, 0.24), 0.1),
    "back": ("torso", (-0.14, 0.0, 0.23), 3.0),
    "upper_arm_left": ("upper_arm_left", (0.0, 0.07, -0.15), 1.5),
    "forearm_left": ("forearm_left", (0.0, 0.06, -0.18), 1.4),
    "thigh_left": ("thigh_left", (0.02, 0.1, -0.26), 1.6),
    "thigh_right": ("thigh_right", (0.0, -0.1, -0.27), -1.6),
    "shin_left": ("shin_left", (0.01, 0.08, -0.18), 1.5),
    "foot_left": ("foot_left", (0.09, 0.05, 0.0), 1.3),
}


def known_body() -> BodyModel:
    """A trunk with a left arm, a left leg and a right thigh, and eleven cameras."""
    joints = tuple(
        Joint(name, parent, child, "ball", rigid(np.eye(3), np.array(offset)))
        for name, (parent, child, offset) in _JOINTS.items()
    )
    segments = ("pelvis", *(joint.child for joint in joints))
    mounts = {
        camera: CameraMount(segment, rigid(_looking_outward(yaw), np.array(position)))
        for camera, (segment, position, yaw) in _CAMERAS.items()
    }
    return BodyModel("known", "pelvis", segments, joints, mounts)


def known_rig(body: BodyModel) -> Rig:
    """The rig file of the body, as a user writes it."""
    parents: dict[str, str | None] = {body.root: None}
    parents |= {joint.child: joint.parent for joint in body.tree_joints}
    return Rig({camera: mount.segment for camera, mount in body.mounts.items()}, parents)


def wide_cameras(names: Collection[str]) -> dict[str, CameraModel]:
    """Equidistant lenses of 150 degrees."""
    K = [245.0, 0.0, 320.0, 0.0, 245.0, 240.0, 0.0, 0.0, 1.0]
    return {name: camera_from_info(name, 640, 480, "equidistant", [0.01, -0.002, 0.0, 0.0], K) for name in names}


@dataclass(frozen=True, eq=False)
class RangeOfMotion:
    """The motion: stamps (T) [ns], poses world_T_segment (T, S, 4, 4), and where each camera is (T, 4, 4)."""

    body: BodyModel
    stamps_ns: NDArray[np.int64]
    world_T_segment: Array
    world_T_camera: Mapping[str, Array]


def range_of_motion(
    body: BodyModel,
    duration_s: float = 9.0,
    rate_hz: float = 15.0,
    heading_rad: float = 0.7,
    held: Collection[str] = (),
    slip: tuple[str, float, Array] | None = None,
    delay_s: float = 0.0,
) -> RangeOfMotion:
    """The N-pose for 1.5 s, then every joint but those held goes through its range; elbow and knee are hinges.

    Args:
        body: whose geometry it is.
        duration_s, rate_hz: of the recording.
        heading_rad: that the person faces.
        held: joints that are held still.
        slip: camera, seconds after the start, and new place on its segment (4, 4) from then on.
        delay_s: of all images, which show what the body did then.
    """
    seconds = delay_s + np.arange(round(duration_s * rate_hz)) / rate_hz
    moving = np.maximum(seconds - STILL_S, 0.0)
    ramp = np.minimum(moving / 0.5, 1.0)[:, None]
    rotations = []
    for number, joint in enumerate(body.tree_joints):
        pace = 2.0 * np.pi * (0.31 + 0.03 * number + np.array([0.0, 0.17, 0.29]))
        if joint.name in held:
            turns = np.zeros((len(seconds), 3))
        elif joint.name in HINGES:
            bend = 0.8 * (1.0 - np.cos(pace[0] * moving))
            turns = bend[:, None] * hinge_axis(joint.name)
        else:
            turns = ramp * np.array([0.5, 0.6, 0.4]) * np.sin(moving[:, None] * pace)
        rotations.append(exp_so3(turns))
    sway = 0.3 * ramp * np.sin(moving[:, None] * np.array([0.7, 0.9, 0.4]))
    world_R_root = exp_so3(np.array([0.0, 0.0, heading_rad]))[None] @ exp_so3(0.4 * sway)
    world_T_root = rigid(world_R_root, np.array([0.3, -0.2, 0.95]) + sway)
    world_T_segment = body.forward_kinematics(world_T_root, np.stack(rotations, axis=1))
    world_T_camera = {}
    for camera, mount in body.mounts.items():
        place = np.repeat(mount.segment_T_camera[None], len(seconds), axis=0)
        if slip and slip[0] == camera:
            place[seconds >= slip[1]] = slip[2]
        world_T_camera[camera] = world_T_segment[:, body.segment_index[mount.segment]] @ place
    stamps_ns = START_NS + np.round(1e9 * seconds).astype(np.int64)
    return RangeOfMotion(body, stamps_ns, world_T_segment, world_T_camera)


def hinge_axis(joint: str) -> Array:
    """(3,) of a hinge, in N-pose axes; people's knees point a little outward."""
    axis = np.array([0.06, 1.0, 0.02]) if joint == "knee_left" else np.array([-0.1, 1.0, 0.0])
    unit: Array = axis / np.linalg.norm(axis)
    return unit


def registrations(
    motion: RangeOfMotion,
    pixel_noise: float = 0.0,
    wrong_share: float = 0.0,
    map_noise: float = 0.0,
    seed: int = 1,
    only: Collection[str] | None = None,
) -> Iterator[LandmarkMatches]:
    """Registrations of every image, in order of time.

    Args:
        motion: of the body.
        pixel_noise: standard deviation [px]; a track keeps its error while it lives.
        wrong_share: of the images that are registered anywhere.
        map_noise: standard deviation of the landmarks in the map [m].
        seed: of the random numbers.
        only: these cameras; all by default.
    """
    random = np.random.default_rng(seed)
    landmarks = _landmarks_around(random)
    in_map = landmarks + map_noise * np.random.default_rng([seed, 7]).normal(size=landmarks.shape)
    cameras = wide_cameras(only or motion.body.mounts)
    for row, stamp_ns in enumerate(motion.stamps_ns):
        generation = int(1e-9 * (stamp_ns - START_NS) / _TRACK_S)
        for name, camera in cameras.items():
            world_T_camera = motion.world_T_camera[name][row]
            points_camera = (landmarks - world_T_camera[:3, 3]) @ world_T_camera[:3, :3]
            pixels, visible = camera.project(points_camera)
            seen = np.flatnonzero(visible & camera.in_image(np.nan_to_num(pixels, nan=-1.0)))[:_SEEN]
            tracks = (seen + generation * len(landmarks)).astype(np.uint32)
            shown = pixels[seen]
            pose, covariance = world_T_camera, np.diag(np.repeat([1e-6, 1e-6], 3))
            if pixel_noise:
                errors = np.random.default_rng([seed, *name.encode(), generation]).normal(size=(len(landmarks), 2))
                shown = shown + pixel_noise * errors[seen]
                fitted = fit_pose(camera, in_map[seen], shown, world_T_camera, PoseFitSettings(), iterations=3)
                pose, covariance = fitted.world_T_camera, np.linalg.inv(fitted.information)
            if random.random() < wrong_share:
                pose = pose @ rigid(exp_so3(random.normal(size=3)), random.normal(size=3))
            yield LandmarkMatches(
                camera=name,
                stamp_ns=int(stamp_ns),
                previous_stamp_ns=int(motion.stamps_ns[row - 1]) if row else 0,
                track_ids=tracks,
                landmark_ids=seen.astype(np.uint32),
                pixels=shown.astype(np.float32) if pixel_noise else shown,  # type: ignore[arg-type]
                points_world=in_map[seen],  # type: ignore[arg-type]
                world_T_camera=pose,
                pose_covariance=covariance,
                current_R_previous=np.eye(3),
                rotation_inliers=0,
            )


def joints_in_cameras(body: BodyModel) -> dict[tuple[str, str], Array]:
    """(camera, joint) -> (3,) where the joint of the camera's segment is in its frame [m], whatever the segment's."""
    places = {}
    for camera, mount in body.mounts.items():
        camera_T_segment = inverse(mount.segment_T_camera)
        for joint in body.joints:
            if mount.segment == joint.child:
                places[camera, joint.name] = camera_T_segment[:3, 3]
            elif mount.segment == joint.parent:
                places[camera, joint.name] = (camera_T_segment @ joint.parent_T_joint)[:3, 3]
    return places


def _looking_outward(yaw: float) -> Array:
    """segment_R_camera of a camera upright on its segment, whose optical axis has a yaw from forward [rad]."""
    forward = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    down = np.array([0.0, 0.0, -1.0])
    return np.stack([np.cross(down, forward), down, forward], axis=1)


def _landmarks_around(random: np.random.Generator) -> Array:
    directions = random.normal(size=(700, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    return np.array([0.0, 0.0, 1.0]) + directions * random.uniform(2.5, 6.0, (700, 1))
