"""Writes a recording as a ros2 bag folder that appears whole or not at all."""

import re
from collections.abc import Iterator, Mapping
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.interfaces import (
    Connection,
    Qos,
    QosDurability,
    QosHistory,
    QosLiveliness,
    QosReliability,
    QosTime,
)

from bodycam_ros.errors import OutputError
from bodycam_ros.files.output_place import check_folder
from bodycam_ros.files.whole_file import failure_named, whole_folder
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.messages.factory import Message
from bodycam_ros.recording.bag_file import METADATA
from bodycam_ros.recording.bag_records import PROGRAM, program_record
from bodycam_ros.recording.mcap_storage import BagWriter
from bodycam_ros.recording.typestore import recording_typestore

_LATCHED_TOPICS = frozenset({"/map/points", "/tf_static", "/verdict"})
"""Topics whose last message a late subscriber still gets; recorded so that ``ros2 bag play`` does the same."""

_LATCHED_ENDINGS = ("/robot_description", "/camera_info", "/timing")
"""And those of every body and robot, and of every camera."""

REPLAY, INGEST = "bodycam replay", "bodycam ingest"
_WRITTEN_BY = "written_by"

_FOREVER = QosTime(9223372036, 854775807)
_LATCHED = Qos(
    history=QosHistory.KEEP_LAST,
    depth=1,
    reliability=QosReliability.RELIABLE,
    durability=QosDurability.TRANSIENT_LOCAL,
    deadline=_FOREVER,
    lifespan=_FOREVER,
    liveliness=QosLiveliness.AUTOMATIC,
    liveliness_lease_duration=_FOREVER,
    avoid_ros_namespace_conventions=False,
)
"""What the publisher of a latched topic offers. Others have ROS's default, as has a topic without a profile."""

_PARTS = re.compile(r"metadata\.yaml|[^/]+\.(mcap|db3)")


class SerializedMessage(NamedTuple):
    """A message ready to be written: topic, type, stamp [ns] and CDR bytes."""

    topic: str
    message_type: str
    stamp_ns: int
    cdr: bytes

    @classmethod
    def of(cls, stamp_ns: int, topic: str, message: Message) -> "SerializedMessage":
        """A message made by ``recorded_messages()``."""
        cdr = bytes(recording_typestore().serialize_cdr(message, message.__msgtype__))
        return cls(topic, message.__msgtype__, stamp_ns, cdr)


class RecordingWriter:
    """Messages into a bag that is being written; ``write_recording`` makes one."""

    def __init__(self, path: Path, writer: BagWriter) -> None:
        self._path = path
        self._writer = writer
        self._connections: dict[str, Connection] = {}

    def write(self, topic: str, stamp_ns: int, message: Message) -> None:
        """Append a message made by ``recorded_messages()``, at its time of recording [ns].

        Raises:
            OutputError: the disk is full, or gone.
        """
        self.write_serialized(*SerializedMessage.of(stamp_ns, topic, message))

    def write_serialized(self, topic: str, message_type: str, stamp_ns: int, cdr: bytes | memoryview) -> None:
        """Append a message that is CDR already, such as one from another process; raises as ``write`` does."""
        with failure_named(self._path):
            if topic not in self._connections:
                self._connections[topic] = self._writer.add_connection(
                    topic,
                    message_type,
                    typestore=recording_typestore(),
                    offered_qos_profiles=[_LATCHED] if is_latched(topic) else [],
                )
            self._writer.write(self._connections[topic], stamp_ns, cdr)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Append a metadata record, what the bag was made from for instance; no wall-clock time, no path of a machine.

        Raises:
            OutputError: it cannot be written.
        """
        with failure_named(self._path):
            self._writer.file.add_metadata(name, values)

    def attach(self, name: str, media_type: str, content: str | bytes, stamp_ns: int = 0) -> None:
        """Append a file, text as UTF-8, logged at a time of the recording [ns].

        Raises:
            OutputError: it cannot be written.
        """
        with failure_named(self._path):
            encoded = content.encode() if isinstance(content, str) else content
            self._writer.file.attach(name, media_type, encoded, stamp_ns)


@contextmanager
def write_recording(path: Path, force: bool = False, command: str = REPLAY) -> Iterator[RecordingWriter]:
    """Write a ros2 bag folder (MCAP). It takes its name once complete; an error or Ctrl-C leaves nothing behind.

    Args:
        path: the folder to be.
        force: replace a bag of the same command that is there already.
        command: for the bag's metadata, which has the versions of program and libraries too.

    Raises:
        OutputError: it cannot be written, or what is there must not be replaced.
    """
    with whole_folder(path, partial(check_replaceable, force, command=command)) as unfinished:
        writer = BagWriter(unfinished)
        writer.set_custom_data(_WRITTEN_BY, command)
        with failure_named(path):
            writer.open()
            writer.file.add_metadata(PROGRAM, program_record(command))
        try:
            yield RecordingWriter(path, writer)
        except BaseException:
            writer.abort()
            raise
        with failure_named(path):
            writer.close()


def check_replaceable(force: bool, path: Path, command: str = REPLAY) -> None:
    """Refuse to replace what is no bag of a command, which can make it again; a recording cannot be made again.

    Raises:
        OutputError: something is at ``path``, and ``force`` is off or it is no bag that the command wrote.
    """
    check_folder(path, force, METADATA, _PARTS, f"bag that '{command}' wrote")
    if not any(path.iterdir()):
        return
    custom: Any = None
    with suppress(OutputError, KeyError, TypeError, AttributeError):
        metadata = read_yaml(path / METADATA, "bag's metadata", OutputError)
        custom = metadata["rosbag2_bagfile_information"]["custom_data"].get(_WRITTEN_BY)
    if custom != command:
        raise OutputError(
            f"{path}: is no bag that '{command}' wrote, so --force does not replace it; choose another name"
        )


def is_latched(topic: str) -> bool:
    """Whether the topic's last message still reaches those that subscribe late."""
    return topic in _LATCHED_TOPICS or topic.endswith(_LATCHED_ENDINGS)
