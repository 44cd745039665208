"""The MCAP file of a bag that is being written, by the format's own library.

Chunks are compressed with zstd and have checksums; the file ends with an index and statistics. Beside messages it takes
metadata records and attachments, which rosbags' own storage does not write. Equal content gives equal bytes.
"""

from collections.abc import Mapping
from pathlib import Path

from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinitionFormat
from rosbags.rosbag2 import StoragePlugin, Writer
from rosbags.rosbag2.enums import CompressionMode

from bodycam_ros import __version__

_ENCODINGS = {MessageDefinitionFormat.MSG: "ros2msg", MessageDefinitionFormat.IDL: "ros2idl"}

ROSBAG2_RECORD = "rosbag2"
"""Metadata record with a copy of metadata.yaml, as rosbag2 writes it."""


class McapStorage:
    """A storage of rosbags' ``Writer``, which has types, quality of service and metadata.yaml.

    Args:
        path: folder of the bag; the file in it takes its name.
        compression: of rosbags, which is not used: chunks are always compressed.

    Raises:
        OSError: the file cannot be written, here and in all methods.
    """

    def __init__(self, path: Path, compression: CompressionMode = CompressionMode.NONE) -> None:
        self.path = path / f"{path.name}.mcap"
        self._file = self.path.open("xb")
        self._writer = McapWriter(self._file, compression=CompressionType.ZSTD)
        self._writer.start(profile="ros2", library=f"bodycam_ros {__version__}")
        self._schemas: dict[str, int] = {}
        self._channels: dict[int, int] = {}

    def add_msgtype(self, connection: Connection) -> None:
        """Add a message type with its definition."""
        definition = connection.msgdef
        encoded = definition.data.encode()
        self._schemas[connection.msgtype] = self._writer.register_schema(
            connection.msgtype, _ENCODINGS[definition.format], encoded
        )

    def add_connection(self, connection: Connection, offered_qos_profiles: str) -> None:
        """Add a topic."""
        assert isinstance(connection.ext, ConnectionExtRosbag2)
        self._channels[connection.id] = self._writer.register_channel(
            connection.topic,
            connection.ext.serialization_format,
            self._schemas[connection.msgtype],
            {"offered_qos_profiles": offered_qos_profiles},
        )

    def write(self, connection: Connection, timestamp: int, data: bytes | memoryview) -> None:
        """Append a message, logged at a time [ns]."""
        self._writer.add_message(self._channels[connection.id], timestamp, bytes(data), timestamp)

    def add_metadata(self, name: str, values: Mapping[str, str]) -> None:
        """Append a metadata record; bytes of a file's name that are no text become escapes."""
        texts = {key: value.encode(errors="backslashreplace").decode() for key, value in values.items()}
        self._writer.add_metadata(name, texts)

    def attach(self, name: str, media_type: str, content: bytes, log_time_ns: int) -> None:
        """Append an attachment, logged at a time [ns]."""
        self._writer.add_attachment(0, log_time_ns, name, media_type, content)

    def close(self, version: int, metadata: str) -> None:
        """Append rosbag2's own record, index and statistics; ``version`` is that of metadata.yaml, which has it too."""
        self.add_metadata(ROSBAG2_RECORD, {"serialized_metadata": metadata})
        self._writer.finish()  # type: ignore[no-untyped-call]
        self._file.close()

    def abort(self) -> None:
        """Close the file without index and end."""
        self._file.close()


class BagWriter(Writer):
    """rosbags' writer of bag folders with this storage."""

    STORAGE_PLUGINS = {StoragePlugin.MCAP: McapStorage}

    def __init__(self, path: Path) -> None:
        super().__init__(path, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP)

    @property
    def file(self) -> McapStorage:
        """The file of an open bag."""
        assert isinstance(self.storage, McapStorage)
        return self.storage
