"""Cut a stretch out of a recording: python -m benchmarks.cut_recording RECORDING OUT --start 0 --duration 2.

The cut holds the bag's images and intrinsics, ``rig.yaml`` and, for scoring, the stretch of ``truth/segments``. The
samples in ``bags/`` were made so, that of a range of motion with ``--cameras`` and ``--every 2``.
"""

import argparse
from collections import Counter
from collections.abc import Collection
from pathlib import Path

import numpy as np
import yaml
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import StoragePlugin, Writer

from bodycam_ros.recording.typestore import recording_typestore


def cut_bag(
    source: Path, target: Path, start_s: float, duration_s: float, cameras: Collection[str], every: int
) -> None:
    """Copy some cameras' messages of a stretch as they are, every so many images, one CameraInfo a second."""
    typestore = recording_typestore()
    with (
        AnyReader([source], default_typestore=typestore) as reader,
        Writer(target, version=Writer.VERSION_LATEST, storage_plugin=StoragePlugin.MCAP) as writer,
    ):
        begin = reader.start_time + round(1e9 * start_s)
        end = begin + round(1e9 * duration_s)
        kept = [c for c in reader.connections if c.topic.split("/")[1] in cameras]
        connections = {c.id: writer.add_connection(c.topic, c.msgtype, typestore=typestore) for c in kept}
        info_due = dict.fromkeys(connections, 0)
        seen: Counter[int] = Counter()
        for connection, stamp, data in reader.messages(kept):
            if not begin <= stamp < end:
                continue
            if connection.topic.endswith("/camera_info"):
                if stamp < info_due[connection.id]:
                    continue
                info_due[connection.id] = stamp + 10**9
            else:
                seen[connection.id] += 1
                if (seen[connection.id] - 1) % every:
                    continue
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
    parser.add_argument("--cameras", nargs="+", help="only these; their segments must hang together")
    parser.add_argument("--no-truth", action="store_true", help="leave the true poses out")
    parser.add_argument("--every", type=int, default=1, help="keep one image of so many")
    arguments = parser.parse_args()
    rig = yaml.safe_load((arguments.recording / "rig.yaml").read_text())
    rig["cameras"] = {c: on for c, on in rig["cameras"].items() if not arguments.cameras or c in arguments.cameras}
    arguments.out.mkdir(parents=True)
    cut_bag(
        arguments.recording / "bag",
        arguments.out / "bag",
        arguments.start,
        arguments.duration,
        rig["cameras"],
        arguments.every,
    )
    if not arguments.no_truth:
        cut_truth(
            arguments.recording / "truth" / "segments",
            arguments.out / "truth" / "segments",
            arguments.start,
            arguments.duration,
        )
    (arguments.out / "rig.yaml").write_text(yaml.safe_dump(rig, sort_keys=False, default_flow_style=None, width=120))


if __name__ == "__main__":
    main()
