"""A short stretch of some of the sample's cameras, written anew with messages changed on the way."""

from collections.abc import Callable, Collection, Mapping
from pathlib import Path

from bodycam_ros.messages.factory import Message
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording

CAMERAS = ("waist_front", "torso_front", "thigh_left")

Alter = Callable[[str, int, Message], Message | None]
"""(topic, number of the message on it, message) -> the message to write, or None to leave it out."""


def write_altered_sample(
    sample: Path,
    target: Path,
    alter: Alter = lambda topic, number, message: message,
    cameras: Collection[str] = CAMERAS,
    frames: int = 8,
    names: Mapping[str, str] | None = None,
) -> Path:
    """Write the first frames of the sample's cameras to ``target``, some of them under the names of others."""
    names = names or {}
    kinds = ("camera_info", "image_raw/compressed")
    counts: dict[str, int] = {}
    with BagFile(sample / "sample" / "bag") as bag, write_recording(target) as writer:
        for topic, stamp_ns, message in bag.messages([f"/{camera}/{kind}" for camera in cameras for kind in kinds]):
            number = counts[topic] = counts.get(topic, -1) + 1
            if number < frames and (altered := alter(topic, number, message)) is not None:
                camera = topic.split("/")[1]
                writer.write(topic.replace(camera, names.get(camera, camera)), stamp_ns, altered)
    return target
