"""Names of topics in a recording that has cameras in a namespace, or under names of other drivers."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import PurePosixPath

from bodycam_ros.errors import RecordingError
from bodycam_ros.messages.images import INFO, TRANSPORTS

_RAW = "/image_raw"
_ENDINGS = tuple(sorted({each.ending.removeprefix(_RAW) for each in TRANSPORTS.values()} - {""}, key=len, reverse=True))


@dataclass(frozen=True)
class TopicNames:
    """How topics of a recording are named here: ``/<camera>/image_raw/compressed``, ``/<camera>/camera_info``, ...

    Attributes:
        prefix: namespace of the topics to read, as "/anna"; topics outside of it are left out. Empty: all are read.
        images: (camera, topic of its images without the transport) of drivers that name them otherwise; the
            camera_info is beside the images, as image_transport has it.
        others: (name here, topic) of other topics, such as an inertial sensor's.
    """

    prefix: str = ""
    images: tuple[tuple[str, str], ...] = ()
    others: tuple[tuple[str, str], ...] = ()

    @classmethod
    def parse(cls, prefix: str, rows: Sequence[str]) -> "TopicNames":
        """Names by a namespace and rows ``CAMERA=TOPIC`` or ``CAMERA/imu=TOPIC``, as on a command line.

        Raises:
            RecordingError: a row is malformed, or a name is given twice.
        """
        images: dict[str, str] = {}
        others: dict[str, str] = {}
        for row in rows:
            name, equals, topic = (part.strip() for part in row.partition("="))
            if not (name and equals and topic.startswith("/")):
                raise RecordingError(
                    f"topics: '{row}' is malformed; expected CAMERA=TOPIC, such as waist_front=/cam0/color/image_raw, "
                    "or CAMERA/imu=TOPIC"
                )
            table = others if "/" in name.strip("/") else images
            if name.strip("/") in table:
                raise RecordingError(f"topics: '{name}' is given twice")
            table[name.strip("/")] = topic if table is others else _without_transport(topic)
        stripped = prefix.strip("/")
        return cls(f"/{stripped}" if stripped else "", tuple(images.items()), tuple(others.items()))

    def own(self, topic: str) -> str | None:
        """Name here of a recording's topic; None where it is not read."""
        for name, given in self.others:
            if topic == given:
                return f"/{name}"
        for camera, images in self.images:
            if topic == images or topic.removeprefix(images) in _ENDINGS:
                return f"/{camera}{_RAW}{topic.removeprefix(images)}"
            if topic == f"{PurePosixPath(images).parent}{INFO}":
                return f"/{camera}{INFO}"
        if not self.prefix:
            return topic
        return topic.removeprefix(self.prefix) if topic.startswith(f"{self.prefix}/") else None


AS_RECORDED = TopicNames()
"""Topics have the names that they have in the recording."""


def _without_transport(topic: str) -> str:
    return next((topic.removesuffix(ending) for ending in _ENDINGS if topic.endswith(ending)), topic)
