"""Samples of the cameras' inertial sensors in a recording: ``/<camera>/imu``, sensor_msgs/Imu."""

from collections.abc import Collection, Iterable
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.messages.imu import IMU_TOPIC, IMU_TYPE, imu_row
from bodycam_ros.recording.bag_file import BagFile


def read_imus(paths: Iterable[Path], cameras: Collection[str]) -> dict[str, ImuSamples]:
    """Camera -> samples of its sensor, of cameras that have one in any of the bags; the first bag counts.

    Raises:
        RecordingError: a bag cannot be read, or one beside the first has no sensor of these cameras.
    """
    found: dict[str, ImuSamples] = {}
    for number, path in enumerate(paths):
        with BagFile(path) as bag:
            topics = {
                topic: camera
                for topic, kind in bag.topics.items()
                if kind == IMU_TYPE and topic.endswith(IMU_TOPIC)
                if (camera := topic.removeprefix("/").removesuffix(IMU_TOPIC)) in cameras and camera not in found
            }
            if number and not topics:
                raise RecordingError(
                    f"{path}: has no inertial sensor of cameras {', '.join(cameras)}; expected topics "
                    f"/<camera>{IMU_TOPIC} ({IMU_TYPE})"
                )
            rows: dict[str, list[tuple[int, tuple[float, ...]]]] = {camera: [] for camera in topics.values()}
            for topic, _, message in bag.messages(topics):
                rows[topics[topic]].append(imu_row(message))
        found |= {camera: ImuSamples.from_rows(each) for camera, each in rows.items()}
    return found
