"""Cut a stretch out of a recording: python test/tools/cut_recording.py RECORDING OUT --start 0 --duration 2.

The cut holds the bag's images and intrinsics, ``rig.yaml`` and, for scoring, the stretch of ``truth/segments``. The
sample in ``bags/`` was made so.
"""

import argparse
import shutil
from pathlib import Path

import numpy as np
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from bodycam_ros.recording.typestore import recording_typestore


def cut_bag(source: Path, target: Path, start_s: float, duration_s: float) -> None:
    """Copy the messages of a stretch as they are, with one CameraInfo of each camera a second."""
    typestore = recording_typestore()
    with (
        AnyReader([source], default_typestore=typestore) as reader,
        Writer(target, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        begin = reader.start_time + round(1e9 * start_s)
        end = begin + round(1e9 * duration_s)
        connections = {c.id: writer.add_connection(c.topic, c.msgtype, typestore=typestore) for c in reader.connections}
        info_due = dict.fromkeys(connections, 0)
        for connection, stamp, data in reader.messages():
            if not begin <= stamp < end:
                continue
            if connection.topic.endswith("/camera_info"):
                if stamp < info_due[connection.id]:
                    continue
                info_due[connection.id] = stamp + 10**9
            writer.write(connections[connection.id], stamp, data)


def cut_truth(source: Path, target: Path, start_s: float, duration_s: float) -> None:
    """Copy the stretch of the true segment poses, and one frame on each side for interpolation."""
    target.mkdir(parents=True)
    for path in sorted(source.glob("*.tum")):
        lines = [line for line in path.read_text().splitlines() if line and not line.startswith("#")]
        stamps = np.array([float(line.split()[0]) for line in lines])
        inside = (stamps >= stamps[0] + start_s - 1e-6) & (stamps < stamps[0] + start_s + duration_s - 1e-6)
        (target / path.name).write_text("".join(f"{line}\n" for line, kept in zip(lines, inside, strict=True) if kept))


def main() -> None:
    """Parse the command line and cut."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path)
    parser.add_argument("out", type=Path)
    parser.add_argument("--start", type=float, default=0.0, help="seconds from the beginning")
    parser.add_argument("--duration", type=float, default=2.0, help="seconds")
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True)
    cut_bag(arguments.recording / "bag", arguments.out / "bag", arguments.start, arguments.duration)
    cut_truth(
        arguments.recording / "truth" / "segments",
        arguments.out / "truth" / "segments",
        arguments.start,
        arguments.duration,
    )
    shutil.copyfile(arguments.recording / "rig.yaml", arguments.out / "rig.yaml")


if __name__ == "__main__":
    main()
