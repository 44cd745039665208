"""A ROS 2 bag, folder or single file, as a stream of decoded messages."""

import logging
import struct
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from functools import cache, cached_property, lru_cache
from pathlib import Path
from types import TracebackType
from typing import Any

from rosbags.interfaces import Connection
from rosbags.rosbag2 import Reader

from bodycam_ros.errors import RecordingError
from bodycam_ros.files.bounded_inputs import is_bounded
from bodycam_ros.files.shown import shown
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.messages.factory import Message
from bodycam_ros.recording.bounded_unpacking import (
    UnpackingError,
    bound_rosbags,
    check_overlap,
    check_packed_file,
    unpack,
)
from bodycam_ros.recording.damaged_bag import DamagedBag
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames
from bodycam_ros.recording.typestore import recording_typestore

_MAGIC = b"\x89MCAP0\r\n"
_ROS1_MAGIC = b"#ROSBAG V"
_FOOTER_LENGTH = 29  # opcode, length, two offsets, checksum; the magic follows
_HEADER_OPCODE, _FOOTER_OPCODE = 0x01, 0x02
_STORAGE_SUFFIXES, _PACKED_SUFFIX = (".mcap", ".db3"), ".zstd"

METADATA = "metadata.yaml"
"""File of a bag folder that lists its topics, and how many messages each has."""


def is_bag(path: Path) -> bool:
    """Whether a path is that of a bag: a folder with metadata, or a file of a bag's kind."""
    return path.suffix.lower() in _STORAGE_SUFFIXES or (path / METADATA).is_file()


def check_files(path: Path) -> None:
    """Refuse what would keep a reader waiting, or fill its memory, before it is opened.

    Raises:
        RecordingError: a pipe or device in the place of a bag's file, metadata that no recorder writes, or a path that
            the system refuses.
    """
    files, packed = [path], list[Path]()
    try:
        if path.is_dir():
            packed = [file for file in path.iterdir() if file.suffix == _PACKED_SUFFIX]
            files = packed + [file for file in path.iterdir() if file.suffix in _STORAGE_SUFFIXES]
            if (metadata := path / METADATA).exists():
                facts = metadata.stat()
                _check_metadata(metadata, facts.st_mtime_ns, facts.st_size)
        for file in files:
            if file.exists() and not file.is_file():
                raise RecordingError(f"{file}: is a folder, pipe or device, not a bag's file")
        for file in packed:
            check_packed_file(file)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}") from error


@lru_cache(maxsize=8)
def _check_metadata(path: Path, changed_ns: int, size: int) -> None:
    """Read a bag's metadata as a whole file of limited YAML, once for each state of it; of a thousand topics it takes
    half a second.

    Raises:
        RecordingError: it cannot be read.
    """
    read_yaml(path, "bag's metadata", RecordingError)


def fault_of(path: Path) -> str | None:
    """Why a bag cannot be read, and what to do; None if nothing is wrong with its files."""
    if not path.exists():
        return "does not exist"
    if path.is_file():
        if path.suffix == ".mcap":
            return _mcap_fault(path)
        if path.suffix not in _STORAGE_SUFFIXES:
            return _ros1_fault(path) or "is not a bag; expected a ros2 bag folder or an .mcap file"
        return None
    files = sorted(f for f in path.iterdir() if f.suffix in _STORAGE_SUFFIXES)
    if not (path / METADATA).exists():
        if files:
            return f"has no metadata.yaml; give the file itself ({files[0].name}), or run 'ros2 bag reindex'"
        inside = None
        with suppress(OSError):  # a folder that cannot be read
            inside = min((each.name for each in path.iterdir() if is_bag(each)), default=None)
        meant = "'bodycam ingest' makes one of videos" if inside is None else f"is {path / inside} meant?"
        return f"is not a ros2 bag folder: it has neither metadata.yaml nor an .mcap file; {meant}"
    for file in files:
        fault = _mcap_fault(file) if file.suffix == ".mcap" else None
        if fault:
            return f"{file.name} {fault}"
    return None


def _ros1_fault(path: Path) -> str | None:
    with path.open("rb") as file:
        if not file.read(len(_ROS1_MAGIC)) == _ROS1_MAGIC:
            return None
    return (
        f"is a bag of ROS 1; convert it: rosbags-convert --src {path.name} --dst {path.stem}, which is installed with "
        "this program"
    )


def _mcap_fault(path: Path) -> str | None:
    """Check the frame of an MCAP file: magic, header's profile, footer, magic."""
    with path.open("rb") as file:
        start = file.read(4096)
        size = file.seek(0, 2)
        file.seek(max(0, size - _FOOTER_LENGTH - len(_MAGIC)))
        end = file.read()
    if not start:
        return "is empty"
    if not start.startswith(_MAGIC):
        return "is not an MCAP file (it does not begin as one)"
    if len(end) != _FOOTER_LENGTH + len(_MAGIC) or not end.endswith(_MAGIC) or end[0] != _FOOTER_OPCODE:
        return (
            "is cut off: it ends without MCAP's footer, as when the recorder was killed or a copy broke off; "
            "'mcap recover' saves what is there"
        )
    profile = _profile(start)
    if profile is not None and profile != "ros2":
        return f"is not from ROS 2, though MCAP: its profile is {shown(profile)}, not 'ros2'; convert it to a ros2 bag"
    return None


def _profile(start: bytes) -> str | None:
    """The profile in the header record, if there is such a record."""
    at = len(_MAGIC)
    if len(start) < at + 13 or start[at] != _HEADER_OPCODE:
        return None
    length = int.from_bytes(start[at + 9 : at + 13], "little")
    return start[at + 13 : at + 13 + length].decode(errors="replace")


_LONGEST_CAUSE = 300
_LATEST_NS = (1 << 63) - 1  # ROS counts in signed 64 bits, MCAP in unsigned ones
_STAMP_END = 12  # behind the four bytes of CDR's byte order
_OF_BODY = ("/robot_description", "/joint_states", "/odometry")
_OUR_MESSAGES = "bodycam_msgs/"
"""A solved body has all of these topics, and some with messages of ours; a robot may have the former."""

logger = logging.getLogger(__name__)


class BagFile:
    """Topics and messages of a ros2 bag folder or an .mcap file. A context manager.

    Standard messages are decoded as Jazzy has them; topics of unknown types can be listed, not read. A bag
    that has one solved body, and that in a namespace, is read as if there were none; what is outside keeps its name.
    A damaged bag is read up to the damage; a warning, one in a process, names the file and the time up to which.

    Args:
        path: of the folder or file.
        names: how its topics are named here.

    Attributes:
        path, names: as given.
        damage: what was found wrong so far, and up to which time the bag is read; empty if nothing was.

    Raises:
        RecordingError: on entering, if there is no readable bag; while reading, if nothing before the damage is whole.
    """

    def __init__(self, path: Path, names: TopicNames = AS_RECORDED) -> None:
        self.path, self.names = path, names
        with _fault_named(path):
            check_files(path)
            self._reader: Reader | DamagedBag = Reader(path)
        self.namespace = self.damage = ""
        self._unpacks = False

    def __enter__(self) -> "BagFile":
        if is_bounded:
            bound_rosbags()
        self._reader = _opened(self.path)
        if isinstance(self._reader, DamagedBag):
            self._note_damage(self._reader.damage, self._reader.end_time - 1)
        else:
            try:
                self._bound_parts(self._reader)
            except BaseException:
                self._reader.close()
                raise
        self.namespace = _namespace(self._reader.connections)
        return self

    def __exit__(
        self, error_type: type[BaseException] | None, error: BaseException | None, traceback: TracebackType | None
    ) -> None:
        self._reader.close()

    def _bound_parts(self, reader: Reader) -> None:
        """Refuse parts that unpack to too much, and have messages that are compressed one by one come as they are."""
        storage: Any = reader.storage
        with _fault_named(self.path):
            check_overlap(getattr(storage, "storages", (storage,)))
        if getattr(storage.metadata, "compression_mode", None) == "message":
            storage.metadata = storage.metadata._replace(compression_mode=None)
            self._unpacks = True

    @cached_property
    def topics(self) -> dict[str, str]:
        """Topic -> message type ("sensor_msgs/msg/Image"), in the order of the topics' names."""
        named = ((self._name(c.topic), c.msgtype) for c in self._reader.connections)
        return dict(sorted((name, kind) for name, kind in named if name))

    def camera_topics(self, ending: str, message_type: str) -> dict[str, str]:
        """Topic -> camera, of the topics ``/<camera><ending>`` of a type."""
        found = {topic: topic.removeprefix("/").removesuffix(ending) for topic in self.topics if topic.endswith(ending)}
        return {topic: camera for topic, camera in found.items() if camera and self.topics[topic] == message_type}

    @property
    def start_ns(self) -> int:
        """When the first message was recorded [ns]."""
        return self._reader.start_time

    @property
    def duration_s(self) -> float:
        """From the first recorded message to the last [s]."""
        return max(0, self._reader.end_time - 1 - self._reader.start_time) * 1e-9 if self._reader.message_count else 0.0

    def message_count(self, topic: str) -> int:
        """Messages on a topic, as the bag's metadata and the statistics in its files have it; some may be missing."""
        if isinstance(self._reader, DamagedBag):
            return max((count for each, count in self._reader.counts.items() if self._name(each) == topic), default=0)
        storage: Any = self._reader.storage
        files = getattr(storage, "storages", ())
        in_files = [c for file in files for c in file.connections if self._name(c.topic) == topic]
        return max(sum(c.msgcount for c in listed) for listed in (self._connections([topic]), in_files))

    def messages(
        self, topics: Collection[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[tuple[str, int, Message]]:
        """Yield topic, time of recording [ns] and message, in order of that time.

        Messages outside ``start_ns`` to ``stop_ns``, which is not included, are skipped. Parts of the file without
        these topics are not decompressed. A message that cannot be decoded is left out, so fewer may come than
        ``message_count``.
        """
        decode = recording_typestore().deserialize_cdr
        for connection, stamp_ns, cdr in self._stream(topics, start_ns, stop_ns):
            try:
                message = decode(cdr, connection.msgtype)
            except Exception:  # damaged bytes can raise nearly anything in a parser
                logger.debug("%s: a message on %s at %d ns cannot be decoded", self.path, connection.topic, stamp_ns)
                continue
            yield self._name(connection.topic), stamp_ns, message

    def header_stamps(self, topics: Collection[str], start_ns: int | None = None) -> Iterator[tuple[str, int, int]]:
        """Yield topic, time of recording [ns] and stamp [ns] of messages that begin with one, in order of the former.

        Those recorded before ``start_ns`` are left out.

        Nothing is decoded: a header's stamp, as that of a foxglove message, is the first eight bytes of a message.
        """
        for connection, recorded_ns, cdr in self._stream(topics, start_ns):
            if len(cdr) >= _STAMP_END:
                seconds, nanoseconds = struct.unpack_from("<II" if cdr[1] & 1 else ">II", cdr, 4)
                yield self._name(connection.topic), recorded_ns, seconds * 1_000_000_000 + nanoseconds

    def _stream(
        self, topics: Collection[str], start_ns: int | None = None, stop_ns: int | None = None
    ) -> Iterator[tuple[Connection, int, bytes]]:
        connections = self._connections(topics)
        stream = self._reader.messages(connections, start=start_ns, stop=stop_ns) if connections else iter(())
        latest_ns: int | None = None
        try:
            for connection, stamp_ns, cdr in stream:
                if stamp_ns > _LATEST_NS:
                    logger.debug("%s: a message on %s of %d ns, no time", self.path, connection.topic, stamp_ns)
                    continue
                latest_ns = stamp_ns
                yield connection, stamp_ns, unpack(cdr) if self._unpacks else cdr
        except UnpackingError as error:
            raise RecordingError(f"{self.path}: {error}") from error
        except Exception as error:  # a damaged file can raise nearly anything in a parser
            cause = _shortened(repr(error))
            if latest_ns is None:
                remedy = "copy it again, or save what 'mcap recover' can"
                raise RecordingError(f"{self.path}: is damaged inside ({cause}); {remedy}") from error
            self._note_damage(f"{self.path}: is damaged inside ({cause})", latest_ns)

    def _note_damage(self, damage: str, until_ns: int) -> None:
        after_s = 1e-9 * (until_ns - self.start_ns)
        self.damage = f"{damage}; it is read up to {after_s:.3f} s after its first message ({until_ns} ns)"
        _warn_once(self.damage)

    def _connections(self, topics: Collection[str]) -> list[Connection]:
        return [c for c in self._reader.connections if self._name(c.topic) in topics]

    def _name(self, topic: str) -> str:
        if self.names != AS_RECORDED:
            # One that is left out has a name that no topic has.
            return self.names.own(topic) or ""
        return topic.removeprefix(self.namespace) if topic.startswith(f"{self.namespace}/") else topic


def _namespace(connections: Sequence[Connection]) -> str:
    """Namespace of the one body that was solved, such as "/anna"; empty where it has none, and of several bodies."""
    topics = {c.topic for c in connections}
    prefixes = ({each.removesuffix(end) for each in topics if each.endswith(end)} for end in _OF_BODY)
    ours = [c.topic for c in connections if c.msgtype.startswith(_OUR_MESSAGES)]
    bodies = {each for each in set.intersection(*prefixes) if any(topic.startswith(f"{each}/") for topic in ours)}
    return bodies.pop() if len(bodies) == 1 else ""


def _opened(path: Path) -> Reader | DamagedBag:
    """A reader of a bag, by its index if that is whole, else up to the damage."""
    with _fault_named(path):
        reader = Reader(path)
        try:
            reader.open()
        except Exception:  # a damaged file can raise nearly anything in a parser
            with suppress(RecordingError):
                return DamagedBag(path)
            raise
        numbers: list[Any] = [reader.start_time, reader.end_time, *(each.msgcount for each in reader.connections)]
        wrong = [each for each in numbers if not isinstance(each, int) or not 0 <= each <= 1 << 64]
        if wrong:
            reader.close()
            raise RecordingError(
                f"{path}: its metadata.yaml has impossible times or counts, such as {shown(wrong[0])}; give the file "
                "itself, or run 'ros2 bag reindex'"
            )
        return reader


@cache
def _warn_once(text: str) -> None:
    """Warn, but not again each time that the same bag is opened."""
    logger.warning("%s", text)


@contextmanager
def _fault_named(path: Path) -> Iterator[None]:
    """Turn whatever a damaged or foreign file makes of the reader into one error that names what is wrong."""
    try:
        yield
    except RecordingError:
        raise
    except UnpackingError as error:
        raise RecordingError(f"{path}: {error}") from error
    except Exception as error:  # a damaged file can raise nearly anything in a parser
        fault = fault_of(path)
        if fault is None:
            reindex = "if its metadata.yaml is damaged, give its file itself, or run 'ros2 bag reindex'"
            remedy = reindex if path.is_dir() else "copy it again"
            fault = f"cannot be read as a ROS 2 bag ({_shortened(repr(error))}); {remedy}"
        raise RecordingError(f"{path}: {fault}") from error


def _shortened(text: str) -> str:
    return text if len(text) <= _LONGEST_CAUSE else f"{text[:_LONGEST_CAUSE]} ..."
