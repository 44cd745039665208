"""Bags that unpack to much more than they are: refused after some megabytes, in a process of little memory."""

from pathlib import Path

import numpy as np
import pytest
import yaml
from helpers.limited_memory import limited_memory
from helpers.naming import naming
from helpers.tiny_bag import write_tiny_bag
from lz4.frame import compress as lz4_compress
from mcap.writer import CompressionType
from mcap.writer import Writer as McapWriter

from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.bounded_unpacking import UnpackingError, unpack, zstd

GIGABYTE = 1 << 30


def packed_zeros(size: int) -> bytes:
    """So many zeros as one frame of zstd, without ever having them."""
    packer = zstd.ZstdCompressor(level=1)
    piece = bytes(1 << 20)
    return b"".join([*(packer.compress(piece) for _ in range(size >> 20)), packer.flush()])


@pytest.fixture(scope="module")
def bomb() -> bytes:
    return packed_zeros(2 * GIGABYTE)


def test_what_a_recorder_packs_is_unpacked() -> None:
    content = np.random.default_rng(1).bytes(100_000) + bytes(10_000_000)
    assert unpack(zstd.compress(content), len(content)) == unpack(zstd.compress(content)) == content
    assert unpack(lz4_compress(content), len(content), "lz4") == content
    assert unpack(zstd.compress(b""), 0) == b""


@pytest.mark.parametrize("stated", [None, 1000, 2 * GIGABYTE])
def test_a_part_that_unpacks_to_too_much_takes_no_memory(bomb: bytes, stated: int | None) -> None:
    with limited_memory(), naming(UnpackingError, f"{len(bomb)} bytes"):
        unpack(bomb, stated)


def write_mcap(path: Path, compression: CompressionType) -> Path:
    with path.open("wb") as file:
        writer = McapWriter(file, chunk_size=1000, compression=compression)
        writer.start(profile="ros2", library="a recorder")
        schema = writer.register_schema("std_msgs/msg/String", "ros2msg", b"string data")
        channel = writer.register_channel("/words", "cdr", schema)
        for stamp in range(50):
            writer.add_message(channel, stamp, b"\0\1\0\0\x65\0\0\0" + 100 * b"a" + b"\0", stamp)
        writer.finish()
    return path


@pytest.mark.parametrize("compression", [CompressionType.ZSTD, CompressionType.LZ4, CompressionType.NONE])
def test_chunks_of_a_recorder_are_read(tmp_path: Path, compression: CompressionType) -> None:
    with BagFile(write_mcap(tmp_path / "words.mcap", compression)) as bag:
        assert [message.data for _, _, message in bag.messages(["/words"])] == [100 * "a"] * 50


def test_chunks_that_overlap_and_are_huge_together_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "words.mcap"
    content = bytearray(write_mcap(path, CompressionType.ZSTD).read_bytes())
    # In the index, each chunk covers all times and claims half a gigabyte.
    at, changed = 0, 0
    while (at := content.find(b"\x08", at)) >= 0:
        length = int.from_bytes(content[at + 1 : at + 9], "little")
        if at + 9 + length <= len(content) and content[at + 9 + length - 20 : at + 9 + length - 16] == b"zstd":
            content[at + 9 : at + 25] = bytes(8) + (10**9).to_bytes(8, "little")
            content[at + 9 + length - 8 : at + 9 + length] = (GIGABYTE // 2).to_bytes(8, "little")
            changed += 1
        at += 1
    assert changed > 2
    path.write_bytes(bytes(content))
    with naming(RecordingError, path), BagFile(path):
        pass


def compressed_folder(folder: Path, mode: str) -> dict[str, object]:
    document: dict[str, object] = yaml.safe_load((folder / "metadata.yaml").read_text())
    information: dict[str, object] = document["rosbag2_bagfile_information"]  # type: ignore[assignment]
    information |= {"compression_format": "zstd", "compression_mode": mode}
    return document


def test_a_file_that_unpacks_to_too_much_is_not_unpacked_to_the_disk(tmp_path: Path, bomb: bytes) -> None:
    bag = write_tiny_bag(tmp_path / "tiny")
    (bag / "tiny.mcap").unlink()
    (bag / "tiny.mcap.zstd").write_bytes(bomb)
    document = compressed_folder(bag, "FILE")
    document["rosbag2_bagfile_information"]["relative_file_paths"] = ["tiny.mcap.zstd"]  # type: ignore[index]
    (bag / "metadata.yaml").write_text(yaml.safe_dump(document))
    with (
        limited_memory(),
        naming(RecordingError, bag / "tiny.mcap.zstd"),
        open_recording(bag),
    ):
        pass


def test_a_whole_file_and_single_messages_that_are_compressed_are_read(tmp_path: Path) -> None:
    bag = write_tiny_bag(tmp_path / "tiny")
    with open_recording(bag) as recording:
        expected = list(recording.images())
    (bag / "tiny.mcap.zstd").write_bytes(zstd.compress((bag / "tiny.mcap").read_bytes()))
    (bag / "tiny.mcap").unlink()
    document = compressed_folder(bag, "FILE")
    document["rosbag2_bagfile_information"]["relative_file_paths"] = ["tiny.mcap.zstd"]  # type: ignore[index]
    (bag / "metadata.yaml").write_text(yaml.safe_dump(document))
    with open_recording(bag) as recording:
        assert list(recording.images()) == expected
