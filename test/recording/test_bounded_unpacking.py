"""Bags that would unpack to gigabytes are refused before they do; compressed bags are read as before."""

import struct
from pathlib import Path

import lz4.frame
import pytest
from limited_memory import limited_memory
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter
from rosbags.rosbag2 import CompressionFormat, CompressionMode, ReaderError, Writer
from rosbags.rosbag2 import reader as rosbags_reader

from bodycam_ros.errors import RecordingError
from bodycam_ros.recording import bounded_unpacking
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bounded_unpacking import _zstd
from bodycam_ros.recording.typestore import recording_typestore

_TOPIC, _TYPE = "/said", "std_msgs/msg/String"
_GIGABYTES = 4 << 30


def bomb(pack: str) -> bytes:
    """Some hundred kilobytes that unpack to four gigabytes of zeros."""
    piece = bytes(1 << 28)
    if pack == "lz4":
        packer = lz4.frame.LZ4FrameCompressor(compression_level=lz4.frame.COMPRESSIONLEVEL_MIN)
        once = packer.begin() + packer.compress(piece) + packer.flush()
    else:
        once = _zstd.compress(piece)
    return once * (_GIGABYTES >> 28)


@pytest.fixture(scope="module")
def packed() -> dict[str, bytes]:
    return {pack: bomb(pack) for pack in ("zstd", "lz4")}


def write_mcap(path: Path, pack: CompressionType) -> Path:
    with path.open("wb") as stream:
        writer = McapWriter(stream, compression=pack)
        writer.start(profile="ros2")
        schema = writer.register_schema(_TYPE, "ros2msg", b"string data")
        channel = writer.register_channel(_TOPIC, "cdr", schema)
        for stamp in range(3):
            writer.add_message(channel, stamp, b"\x00\x01\x00\x00\x03\x00\x00\x00hi\x00", stamp)
        writer.finish()
    return path


def with_chunk(path: Path, content: bytes, size: int) -> None:
    """Put other content into the file's one chunk, which lies between the header and the chunk's indices."""
    whole = path.read_bytes()
    at = whole.index(b"\x06", 8 + 9 + struct.unpack_from("<Q", whole, 9)[0])
    head = bytearray(whole[at + 9 : at + 9 + 32])
    head[16:24] = struct.pack("<Q", size)
    head[24:28] = bytes(4)  # no checksum
    (name,) = struct.unpack_from("<I", head, 28)
    record = bytes(head) + whole[at + 41 : at + 41 + name] + struct.pack("<Q", len(content)) + content
    # Without the summary the reader goes through the file from its start.
    footer = b"\x02" + struct.pack("<QQQI", 20, 0, 0, 0)
    end = b"\x0f" + struct.pack("<QI", 4, 0)
    path.write_bytes(whole[:at] + b"\x06" + struct.pack("<Q", len(record)) + record + end + footer + whole[-8:])


def said(path: Path) -> list[str]:
    with BagFile(path) as bag:
        return [message.data for _, _, message in bag.messages([_TOPIC])]


@pytest.mark.parametrize("pack", [CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE])
def test_chunks_are_read_as_before(pack: CompressionType, tmp_path: Path) -> None:
    assert said(write_mcap(tmp_path / "a.mcap", pack)) == ["hi"] * 3


@pytest.mark.parametrize("claimed", [100, _GIGABYTES])
@pytest.mark.parametrize("pack", ["zstd", "lz4"])
def test_a_chunk_that_is_a_bomb(pack: str, claimed: int, packed: dict[str, bytes], tmp_path: Path) -> None:
    path = write_mcap(tmp_path / "a.mcap", CompressionType[pack.upper()])
    with_chunk(path, packed[pack], claimed)
    with limited_memory(), pytest.raises(RecordingError, match="than the 100 bytes|in one piece"):
        said(path)


@pytest.mark.parametrize("mode", [CompressionMode.FILE, CompressionMode.MESSAGE])
def test_bags_that_ros_compressed(mode: CompressionMode, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    writer = Writer(tmp_path / "bag", version=9)
    writer.set_compression(mode, CompressionFormat.ZSTD)
    with writer:
        connection = writer.add_connection(_TOPIC, _TYPE, typestore=recording_typestore())
        for stamp in range(3):
            writer.write(connection, stamp, b"\x00\x01\x00\x00" + struct.pack("<I", 5000) + b"h" * 4999 + b"\x00")
    assert said(tmp_path / "bag") == ["h" * 4999] * 3
    for limit in ("MOST_CHUNK", "_SMALL", "_MOST_TIMES"):
        monkeypatch.setattr(bounded_unpacking, limit, 1)
    with pytest.raises(RecordingError, match="than the 1 bytes|times its size"):
        said(tmp_path / "bag")


def test_nothing_is_unpacked_beyond_the_limit(packed: dict[str, bytes], monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(bounded_unpacking, "MOST_CHUNK", 1 << 20)
    with limited_memory(64 << 20), pytest.raises(ReaderError, match="more than the 1048576 bytes"):
        rosbags_reader.zstd.decompress(packed["zstd"])


@pytest.mark.parametrize("kind", ["lz4", "zstd"])
def test_frames_without_end_are_refused(kind: str) -> None:
    """What they cost grows faster than their number."""
    empty = {"lz4": lz4.frame.compress, "zstd": _zstd.compress}[kind](b"")
    with pytest.raises(ReaderError, match="more than 1000 compressed frames"):
        bounded_unpacking.storage_mcap.DECOMPRESSORS[kind](1001 * empty, 10)
    assert bounded_unpacking.storage_mcap.DECOMPRESSORS[kind](1000 * empty, 10) == b""
