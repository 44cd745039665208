"""CPU time of writing and reading a bag: its messages by rosbags' own storage and by ours, then its images from each.

.venv/bin/python -m benchmarks.bag_speed bags/sample/bag
"""

import argparse
import shutil
from collections.abc import Callable
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory
from time import process_time

from rosbags.rosbag2 import Reader, StoragePlugin, Writer

from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recording_typestore

ROUNDS = 9

Messages = list[tuple[str, str, int, bytes]]


def write_by_rosbags(messages: Messages, path: Path) -> None:
    """Without compression and checksums, as bags were written before."""
    with Writer(path, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer:
        connections = {}
        for topic, kind, stamp_ns, cdr in messages:
            if topic not in connections:
                connections[topic] = writer.add_connection(topic, kind, typestore=recording_typestore())
            writer.write(connections[topic], stamp_ns, cdr)


def write_by_mcap(messages: Messages, path: Path) -> None:
    """As bodycam writes bags, brought to the disk."""
    with write_recording(path) as writer:
        for message in messages:
            writer.write_serialized(*message)


def read(path: Path) -> None:
    """Every message, decoded."""
    with BagFile(path) as bag:
        for _ in bag.messages(bag.topics):
            pass


def main() -> None:
    """Print a line for each storage."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("bag", type=Path, metavar="BAG")
    with Reader(parser.parse_args().bag) as bag:
        messages = [(each.topic, each.msgtype, stamp_ns, bytes(cdr)) for each, stamp_ns, cdr in bag.messages()]
    writers: dict[str, Callable[[Messages, Path], None]] = {"rosbags": write_by_rosbags, "mcap": write_by_mcap}
    times: dict[str, list[tuple[float, float]]] = {name: [] for name in writers}
    size_mb = {}
    with TemporaryDirectory() as folder:
        for _ in range(ROUNDS):
            for name, write in writers.items():
                path = Path(folder) / name
                shutil.rmtree(path, ignore_errors=True)
                started_s = process_time()
                write(messages, path)
                written_s = process_time()
                read(path)
                times[name].append((written_s - started_s, process_time() - written_s))
                size_mb[name] = 1e-6 * (path / f"{name}.mcap").stat().st_size
    for name, rounds in times.items():
        writing, reading = (1e3 * median(column) for column in zip(*rounds, strict=True))
        print(f"{name}: {size_mb[name]:.1f} MB, {writing:.0f} ms to write, {reading:.0f} ms to read")


if __name__ == "__main__":
    main()
