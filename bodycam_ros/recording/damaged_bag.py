"""A bag whose index or end is damaged, read from its start up to the damage.

rosbags reads a file by the index at its end. A recorder that was killed, a full disk or a broken copy leave none: then
the records are read one after the other, by the format's own library.
"""

import io
from collections import Counter
from collections.abc import Collection, Iterator, Sequence
from heapq import merge
from operator import itemgetter
from pathlib import Path
from typing import NamedTuple

from mcap.records import Channel, Chunk, DataEnd, Header, McapRecord, Message, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from rosbags.interfaces import Connection, ConnectionExtRosbag2, MessageDefinition, MessageDefinitionFormat

from bodycam_ros.errors import RecordingError
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.recording.bounded_unpacking import check_stated

_INFORMATION = "rosbag2_bagfile_information"
_MAGIC = b"\x89MCAP0\r\n"
_COMPRESSIONS = ("", "lz4", "zstd")
_FILES_APART = 1 << 16  # channels of a file are numbered below


class _Block(NamedTuple):
    """A chunk, or a message outside any: file, where in it, and times of its first and last message [ns]."""

    file: int
    offset: int
    start_ns: int
    end_ns: int


class DamagedBag:
    """What is whole in a damaged bag, up to the first damage; named as the members of rosbags' ``Reader``.

    Attributes:
        connections: topics of which a message is there.
        start_time: of the first message [ns].
        end_time: one more than that of the last message before the damage [ns].
        message_count: of all messages before the damage.
        counts: topic -> messages: those that metadata.yaml counts where it is there, else those before the damage.
        damage: the file, and what was found in it.

    Args:
        path: bag folder with metadata.yaml, or .mcap file.

    Raises:
        RecordingError: it is no such bag, or not one message is before the damage.
    """

    def __init__(self, path: Path) -> None:
        files, self.counts = _listed(path) if path.is_dir() else ([path], {})
        self._files: list[io.BufferedReader] = []
        self._blocks: list[_Block] = []
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        found: Counter[int] = Counter()
        self.damage = f"{path}: its index is damaged"
        try:
            for file in files:
                self._files.append(file.open("rb"))
                if (fault := self._scan(found)) is not None:
                    self.damage = f"{file}: {fault}"
                    break
        except OSError as error:
            self.damage = f"{file}: {error.strerror or error}"
        if not found:
            self.close()
            raise RecordingError(f"{self.damage}, and no message before that is whole")
        self.connections = [self._connection(number, found[number]) for number in sorted(found)]
        self.start_time = min(block.start_ns for block in self._blocks)
        self.end_time = max(block.end_ns for block in self._blocks) + 1
        self.message_count = found.total()
        for connection in () if self.counts else self.connections:
            self.counts[connection.topic] = self.counts.get(connection.topic, 0) + connection.msgcount

    def close(self) -> None:
        """Close the files."""
        for file in self._files:
            file.close()

    def messages(
        self, connections: Collection[Connection] = (), start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        """Yield topic, time of recording [ns] and bytes of messages, in order of that time.

        Args:
            connections: of the topics.
            start: the first time [ns].
            stop: the time after the last [ns].
        """
        wanted = {connection.id: connection for connection in connections}
        start_ns, stop_ns = start or 0, self.end_time if stop is None else stop

        def of(block: _Block) -> Iterator[tuple[int, Connection | None, bytes]]:
            yield block.start_ns, None, b""  # the block is not read before its time has come
            first = block.file * _FILES_APART
            within = (each for each in self._messages_of(block) if start_ns <= each.log_time < stop_ns)
            messages = ((each.log_time, wanted.get(first + each.channel_id), each.data) for each in within)
            yield from sorted((each for each in messages if each[1] is not None), key=itemgetter(0))

        blocks = [of(block) for block in self._blocks if block.end_ns >= start_ns and block.start_ns < stop_ns]
        for stamp_ns, connection, data in merge(*blocks, key=itemgetter(0)):
            if connection is not None:
                yield connection, stamp_ns, data

    def _scan(self, found: Counter[int]) -> str | None:
        """Note the blocks of the last file; what is wrong with it, None if all of its messages are whole."""
        number, file = len(self._files) - 1, self._files[-1]
        size = file.seek(0, io.SEEK_END)
        at = file.seek(len(_MAGIC))
        try:
            for record in StreamReader(file, skip_magic=True, emit_chunks=True, record_size_limit=size).records:
                if isinstance(record, DataEnd):
                    return None
                if isinstance(record, Header) and record.profile != "ros2":
                    return "is not of ROS 2"
                messages = [message for message in self._noted(number, record) if self._is_of_channel(number, message)]
                if messages:
                    times_ns = [message.log_time for message in messages]
                    self._blocks.append(_Block(number, at, min(times_ns), max(times_ns)))
                    found.update(number * _FILES_APART + message.channel_id for message in messages)
                at = file.tell()
        except Exception as error:  # damaged bytes can raise nearly anything in a parser
            return "is cut off" if file.tell() == size else f"is damaged at byte {at} of {size} ({error!r})"
        return "is cut off"

    def _noted(self, file: int, record: McapRecord) -> Iterator[Message]:
        """The messages of a record; its schemas and channels are noted."""
        for each in _records_in(record):
            if isinstance(each, Schema):
                self._schemas[file * _FILES_APART + each.id] = each
            elif isinstance(each, Channel):
                self._channels[file * _FILES_APART + each.id] = each
            elif isinstance(each, Message):
                yield each

    def _is_of_channel(self, file: int, message: Message) -> bool:
        return file * _FILES_APART + message.channel_id in self._channels

    def _messages_of(self, block: _Block) -> list[Message]:
        file = self._files[block.file]
        file.seek(block.offset)
        record = next(StreamReader(file, skip_magic=True, emit_chunks=True).records)
        return [each for each in _records_in(record) if isinstance(each, Message)]

    def _connection(self, number: int, count: int) -> Connection:
        channel = self._channels[number]
        schema = self._schemas.get(number - channel.id + channel.schema_id)
        definition = MessageDefinition(MessageDefinitionFormat.NONE, "")
        how = ConnectionExtRosbag2(channel.message_encoding, [])
        return Connection(
            number, channel.topic, "" if schema is None else schema.name, definition, "", count, how, self
        )


def _records_in(record: McapRecord) -> Sequence[McapRecord]:
    """The records of a chunk, or the record itself; raises whatever a damaged one makes of the library."""
    if not isinstance(record, Chunk):
        return [record]
    if record.compression not in _COMPRESSIONS or not (
        record.compression or len(record.data) == record.uncompressed_size
    ):
        raise ValueError(f"a chunk of {len(record.data)} bytes, compressed as {record.compression!r}")
    check_stated(len(record.data), record.uncompressed_size)
    return breakup_chunk(record, validate_crc=True)


def _listed(path: Path) -> tuple[list[Path], dict[str, int]]:
    """The files of a bag folder in their order, and its topics with their counts, as metadata.yaml has them."""
    try:
        information = read_yaml(path / "metadata.yaml", "bag's metadata", RecordingError)[_INFORMATION]
        if information.get("compression_mode") or information["storage_identifier"] != "mcap":
            raise RecordingError(f"{path}: is damaged, and not of a kind that is read up to the damage")
        files = [path / Path(name).name for name in information["relative_file_paths"]]
        topics = information["topics_with_message_count"]
        return files, {str(each["topic_metadata"]["name"]): int(each["message_count"]) for each in topics}
    except (KeyError, TypeError, ValueError, AttributeError, OverflowError) as error:
        raise RecordingError(f"{path}: metadata.yaml is damaged ({error!r})") from error
