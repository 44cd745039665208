"""A long recording made of a short one, played forward and backward: python -m benchmarks.loop_recording BAG OUT.

Images are copied as they are with new stamps, so that the motion goes on without a jump; one CameraInfo of each camera.
The stamps of a camera stay apart by as much as they were, so cameras that share their stamps still do.
"""

import argparse
import struct
from collections.abc import Iterator, Sequence
from itertools import cycle
from pathlib import Path

from rosbags.highlevel import AnyReader
from rosbags.interfaces import Connection
from rosbags.rosbag2 import StoragePlugin, Writer

from bodycam_ros.recording.typestore import recording_typestore

_INFO = "/camera_info"

Recorded = tuple[Connection, int, bytes]
"""Topic, time of recording [ns] and CDR bytes of a message."""


def loop_bag(source: Path, target: Path, lasting_s: float) -> None:
    """Write a bag that plays another one to and fro for some time [s]; video cannot be played backward."""
    typestore = recording_typestore()
    with (
        AnyReader([source], default_typestore=typestore) as reader,
        Writer(target, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        there = {c.id: writer.add_connection(c.topic, c.msgtype, typestore=typestore) for c in reader.connections}
        images, described = list[Recorded](), set[int]()
        for connection, recorded_ns, cdr in reader.messages():
            if not connection.topic.endswith(_INFO):
                images.append((connection, recorded_ns, bytes(cdr)))
            elif connection.id not in described:
                described.add(connection.id)
                writer.write(there[connection.id], recorded_ns, cdr)
        for connection, recorded_ns, cdr in _to_and_fro(images, lasting_s):
            writer.write(there[connection.id], recorded_ns, cdr)


def _to_and_fro(images: Sequence[Recorded], lasting_s: float) -> Iterator[Recorded]:
    first_ns, last_ns = images[0][1], images[-1][1]
    latest: dict[int, int] = {}
    at_ns, until_ns = first_ns, first_ns + round(1e9 * lasting_s)
    for step in cycle((1, -1)):
        for connection, recorded_ns, cdr in images[::step]:
            by_ns = at_ns - first_ns if step == 1 else at_ns + last_ns - 2 * recorded_ns
            if recorded_ns + by_ns >= until_ns:
                return
            # The image between the two directions occurs once.
            if latest.get(connection.id) == recorded_ns + by_ns:
                continue
            latest[connection.id] = recorded_ns + by_ns
            yield connection, recorded_ns + by_ns, _restamped(cdr, by_ns)
        at_ns += last_ns - first_ns


def _restamped(cdr: bytes, by_ns: int) -> bytes:
    """A message that begins with a header, its stamp moved [ns]."""
    order = "<" if cdr[1] & 1 else ">"
    seconds, nanoseconds = struct.unpack_from(f"{order}iI", cdr, 4)
    stamp_ns = seconds * 1_000_000_000 + nanoseconds + by_ns
    return cdr[:4] + struct.pack(f"{order}iI", *divmod(stamp_ns, 1_000_000_000)) + cdr[12:]


def main() -> None:
    """Parse the command line and write the bag."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("output", type=Path)
    parser.add_argument("--seconds", type=float, default=60.0)
    arguments = parser.parse_args()
    loop_bag(arguments.recording, arguments.output, arguments.seconds)


if __name__ == "__main__":
    main()
