"""Samples of the inertial sensors of cameras, from the recording's bag or from others."""

from collections.abc import Collection, Iterable
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.messages.imu import IMU_TOPIC, IMU_TYPE, imu_row
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames


def sensor_topics(bag: BagFile, cameras: Collection[str], required: bool = True) -> dict[str, str]:
    """Topic -> camera, of cameras whose inertial sensor is in a bag.

    Raises:
        RecordingError: none is, though one is required.
    """
    expected = {f"/{camera}{IMU_TOPIC}": camera for camera in sorted(cameras)}
    topics = {topic: camera for topic, camera in expected.items() if bag.topics.get(topic) == IMU_TYPE}
    if required and not topics:
        raise RecordingError(
            f"{bag.path}: has no inertial sensor of the cameras; expected topics {', '.join(expected)} ({IMU_TYPE})"
        )
    return topics


def read_imus(
    paths: Iterable[Path], cameras: Collection[str], names: TopicNames = AS_RECORDED
) -> dict[str, ImuSamples]:
    """Camera -> samples of its sensor, of cameras that have one in any of the bags; the first bag counts.

    Raises:
        RecordingError: a bag cannot be read, or one beside the first has no sensor of these cameras.
    """
    found: dict[str, ImuSamples] = {}
    for number, path in enumerate(paths):
        with BagFile(path, names) as bag:
            topics = sensor_topics(bag, {*cameras} - {*found}, required=number > 0)
            rows: dict[str, list[tuple[int, tuple[float, ...]]]] = {camera: [] for camera in topics.values()}
            for topic, _, message in bag.messages(topics):
                rows[topics[topic]].append(imu_row(message))
        found |= {camera: ImuSamples.from_rows(each) for camera, each in rows.items()}
    return found
