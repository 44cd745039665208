"""What travels between the stages: feature tracks, landmark matches, camera poses."""

import numpy as np

from bodycam_ros.messages.factory import Message, MessageFactory, flat, numbers
from bodycam_ros.messages.header import header_message, optical_frame, stamp_ns, time_message
from bodycam_ros.messages.pose import (
    pose_and_covariance,
    pose_with_covariance_message,
    quaternion_message,
    rotation_from_message,
    stamped_pose_message,
)
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.tracking.keypoints import DESCRIPTOR_LENGTH
from bodycam_ros.tracking.track_frame import TrackFrame


def tracks_message(make: MessageFactory, frame: TrackFrame) -> Message:
    """bodycam_msgs/FeatureTracks of a track frame."""
    return make(
        "bodycam_msgs/msg/FeatureTracks",
        header=header_message(make, frame.stamp_ns, make.frame(optical_frame(frame.camera))),
        previous_stamp=time_message(make, frame.previous_stamp_ns),
        track_ids=make.sequence(flat(frame.track_ids, np.uint32)),
        pixels=make.sequence(flat(frame.pixels, np.float32)),
        described=make.sequence(flat(frame.described, np.uint32)),
        descriptors=make.sequence(flat(frame.descriptors, np.uint8)),
        scales=make.sequence(flat(frame.scales, np.float32)),
        keyframe=bool(frame.keyframe),
        current_r_previous=quaternion_message(make, frame.current_R_previous),
        landmark_ids=make.sequence(flat(np.zeros(0) if frame.landmark_ids is None else frame.landmark_ids, np.uint32)),
        rotation_inliers=int(frame.rotation_inliers),
    )


def track_frame(message: Message, camera: str) -> TrackFrame:
    """Track frame of a bodycam_msgs/FeatureTracks that came on the camera's topic.

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
    )


def landmarks_message(make: MessageFactory, matches: LandmarkMatches) -> Message:
    """bodycam_msgs/LandmarkMatches of landmark matches."""
    registered = matches.world_T_camera is not None
    world_T_camera = np.eye(4) if matches.world_T_camera is None else matches.world_T_camera
    return make(
        "bodycam_msgs/msg/LandmarkMatches",
        header=header_message(make, matches.stamp_ns, make.frame(optical_frame(matches.camera))),
        previous_stamp=time_message(make, matches.previous_stamp_ns),
        track_ids=make.sequence(flat(matches.track_ids, np.uint32)),
        landmark_ids=make.sequence(flat(matches.landmark_ids, np.uint32)),
        pixels=make.sequence(flat(matches.pixels, np.float32)),
        shifts=make.sequence(flat(np.zeros(0) if matches.shifts is None else matches.shifts, np.float32)),
        points=make.sequence(flat(matches.points_world, np.float32)),
        registered=registered,
        pose=pose_with_covariance_message(make, world_T_camera, matches.pose_covariance),
        current_r_previous=quaternion_message(make, matches.current_R_previous),
        rotation_inliers=int(matches.rotation_inliers),
        readout_time=float(matches.readout_time),
        readout_sigma=float(matches.readout_sigma),
        grown=int(matches.grown),
    )


def landmark_matches(message: Message, camera: str) -> LandmarkMatches:
    """Landmark matches of a bodycam_msgs/LandmarkMatches that came on the camera's topic.

    Raises:
        ValueError: the lengths of the arrays disagree, or a registered pose is not finite.
    """
    count = len(message.track_ids)
    world_T_camera, covariance = pose_and_covariance(message.pose)
    if message.registered and not (np.isfinite(world_T_camera).all() and np.isfinite(covariance).all()):
        raise ValueError("a registered pose, or its covariance, is not finite")
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
        readout_time=float(message.readout_time),
        readout_sigma=float(message.readout_sigma),
        grown=int(message.grown),
    )


def camera_pose_message(make: MessageFactory, matches: LandmarkMatches) -> Message | None:
    """geometry_msgs/PoseWithCovarianceStamped of the optical frame in the map; None while the camera is lost."""
    if matches.world_T_camera is None:
        return None
    return stamped_pose_message(make, matches.stamp_ns, matches.world_T_camera, matches.pose_covariance)
