"""Messages between the stages: feature tracks, landmark matches, camera poses, map points."""

import math

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.model import optical_frame
from bodycam_ros.camera.readout import readout_of
from bodycam_ros.messages.factory import (
    MAP_FRAME,
    Message,
    MessageFactory,
    flat,
    header_message,
    numbers,
    stamp_ns,
    time_message,
)
from bodycam_ros.messages.poses import (
    pose_and_covariance,
    pose_message,
    pose_with_covariance_message,
    quaternion_message,
    rotation_from_message,
    transform_from_pose,
)
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.tracking.track_frame import DESCRIPTOR_LENGTH, TrackFrame

TRACKS_TYPE, LANDMARKS_TYPE = "bodycam_msgs/msg/FeatureTracks", "bodycam_msgs/msg/LandmarkMatches"


def image_messages(
    make: MessageFactory, frame: TrackFrame, matches: LandmarkMatches
) -> tuple[Message, Message, Message | None]:
    """Tracks, landmarks and pose of one image: ``tracks_message``, ``landmarks_message``, ``camera_pose_message``."""
    landmarks = landmarks_message(make, matches)
    is_judged = frame.world_T_camera is matches.world_T_camera  # the tracker's own pose
    tracks = tracks_message(make, frame, landmarks.pose.pose if is_judged else None)
    return tracks, landmarks, camera_pose_message(make, landmarks)


def tracks_message(make: MessageFactory, frame: TrackFrame, pose: Message | None = None) -> Message:
    """bodycam_msgs/FeatureTracks of a track frame; ``pose``: its geometry_msgs/Pose, where that is made already."""
    if pose is None:
        pose = pose_message(make, np.eye(4) if frame.world_T_camera is None else frame.world_T_camera)
    information = np.zeros((6, 6)) if frame.pose_information is None else frame.pose_information
    return make(
        TRACKS_TYPE,
        header=header_message(make, frame.stamp_ns, make.frame(optical_frame(frame.camera))),
        previous_stamp=time_message(make, frame.previous_stamp_ns),
        track_ids=make.array(frame.track_ids, np.uint32),
        pixels=make.array(frame.pixels, np.float32),
        described=make.array(frame.described, np.uint32),
        descriptors=make.array(frame.descriptors, np.uint8),
        scales=make.array(frame.scales, np.float32),
        keyframe=bool(frame.keyframe),
        current_r_previous=quaternion_message(make, frame.current_R_previous),
        landmark_ids=make.array(frame.landmark_ids, np.uint32),
        rotation_inliers=int(frame.rotation_inliers),
        located=frame.world_T_camera is not None,
        pose=pose,
        pose_information=flat(information, np.float64),
        shifts=make.array(frame.shifts, np.float64),
        map_identity=frame.map_identity,
    )


def track_frame(message: Message, camera: str) -> TrackFrame:
    """Track frame of a bodycam_msgs/FeatureTracks on the camera's topic.

    Raises:
        ValueError: the lengths of the arrays disagree.
    """
    track_count, described_count = len(message.track_ids), len(message.described)
    return TrackFrame(
        camera=camera,
        stamp_ns=stamp_ns(message.header.stamp),
        previous_stamp_ns=stamp_ns(message.previous_stamp),
        track_ids=numbers(message.track_ids, np.uint32, track_count),
        pixels=numbers(message.pixels, np.float32, track_count, 2),
        described=numbers(message.described, np.uint32, described_count),
        descriptors=numbers(message.descriptors, np.uint8, described_count, DESCRIPTOR_LENGTH),
        scales=numbers(message.scales, np.float32, described_count),
        keyframe=bool(message.keyframe),
        current_R_previous=rotation_from_message(message.current_r_previous),
        rotation_inliers=int(message.rotation_inliers),
        landmark_ids=numbers(message.landmark_ids, np.uint32, track_count) if len(message.landmark_ids) else None,
        world_T_camera=transform_from_pose(message.pose) if message.located else None,
        pose_information=numbers(message.pose_information, np.float64, 6, 6) if message.located else None,
        shifts=numbers(message.shifts, np.float64, track_count, 2) if message.located else None,
        map_identity=message.map_identity,
    )


def landmarks_message(make: MessageFactory, matches: LandmarkMatches) -> Message:
    """bodycam_msgs/LandmarkMatches of landmark matches."""
    world_T_camera = np.eye(4) if matches.world_T_camera is None else matches.world_T_camera
    return make(
        LANDMARKS_TYPE,
        header=header_message(make, matches.stamp_ns, make.frame(optical_frame(matches.camera))),
        previous_stamp=time_message(make, matches.previous_stamp_ns),
        track_ids=make.array(matches.track_ids, np.uint32),
        landmark_ids=make.array(matches.landmark_ids, np.uint32),
        pixels=make.array(matches.pixels, np.float32),
        shifts=make.array(matches.shifts, np.float32),
        points=make.array(matches.points_world, np.float32),
        registered=matches.world_T_camera is not None,
        pose=pose_with_covariance_message(make, world_T_camera, matches.pose_covariance),
        current_r_previous=quaternion_message(make, matches.current_R_previous),
        rotation_inliers=int(matches.rotation_inliers),
        readout_time=math.nan if matches.readout is None else matches.readout.seconds,
        readout_sigma=math.nan if matches.readout is None else matches.readout.sigma,
        grown=int(matches.grown),
        map_identity=matches.map_identity,
        tracks_map_identity=matches.tracks_map_identity,
    )


def landmark_matches(message: Message, camera: str) -> LandmarkMatches:
    """Landmark matches of a bodycam_msgs/LandmarkMatches on the camera's topic.

    Raises:
        ValueError: the lengths of the arrays disagree, a registered pose is not finite, or its covariance is none.
    """
    count = len(message.track_ids)
    world_T_camera, covariance = pose_and_covariance(message.pose)
    if message.registered and not (np.isfinite(world_T_camera).all() and np.isfinite(covariance).all()):
        raise ValueError("a registered pose, or its covariance, is not finite")
    if message.registered and np.linalg.eigvalsh(covariance)[0] <= 0.0:
        raise ValueError("the covariance of a registered pose is not positive definite")
    return LandmarkMatches(
        camera=camera,
        stamp_ns=stamp_ns(message.header.stamp),
        previous_stamp_ns=stamp_ns(message.previous_stamp),
        track_ids=numbers(message.track_ids, np.uint32, count),
        landmark_ids=numbers(message.landmark_ids, np.uint32, count),
        pixels=numbers(message.pixels, np.float32, count, 2),
        points_world=numbers(message.points, np.float32, count, 3),
        world_T_camera=world_T_camera if message.registered else None,
        pose_covariance=covariance,
        current_R_previous=rotation_from_message(message.current_r_previous),
        rotation_inliers=int(message.rotation_inliers),
        shifts=numbers(message.shifts, np.float32, count, 2) if len(message.shifts) else None,
        readout=readout_of(message.readout_time, message.readout_sigma),
        grown=int(message.grown),
        map_identity=message.map_identity,
        tracks_map_identity=message.tracks_map_identity,
    )


def camera_pose_message(make: MessageFactory, landmarks: Message) -> Message | None:
    """geometry_msgs/PoseWithCovarianceStamped of the optical frame in the map, by its landmarks; or None."""
    if not landmarks.registered:
        return None
    header = make("std_msgs/msg/Header", stamp=landmarks.header.stamp, frame_id=MAP_FRAME)
    return make("geometry_msgs/msg/PoseWithCovarianceStamped", header=header, pose=landmarks.pose)


_FLOAT32 = 7  # sensor_msgs/PointField
_FIELDS = ("x", "y", "z", "rgb")


def map_points_message(
    make: MessageFactory, stamp_ns: int, points_world: NDArray[np.floating], colours: NDArray[np.uint8]
) -> Message:
    """sensor_msgs/PointCloud2 of coloured points in the map's frame.

    Args:
        points_world: (N, 3) [m].
        colours: (N, 3) red, green, blue.
    """
    rgb = colours.astype(np.uint32) @ np.array([1 << 16, 1 << 8, 1], dtype=np.uint32)
    # RViz reads a colour from the bits of a float.
    rows = np.column_stack([points_world.astype(np.float32), rgb.astype(np.uint32).view(np.float32)])
    step = 4 * len(_FIELDS)
    return make(
        "sensor_msgs/msg/PointCloud2",
        header=header_message(make, stamp_ns, MAP_FRAME),
        height=1,
        width=len(rows),
        fields=[
            make("sensor_msgs/msg/PointField", name=name, offset=4 * i, datatype=_FLOAT32, count=1)
            for i, name in enumerate(_FIELDS)
        ],
        is_bigendian=False,
        point_step=step,
        row_step=step * len(rows),
        data=make.library.sequence(flat(rows, np.float32).view(np.uint8)),
        is_dense=True,
    )
