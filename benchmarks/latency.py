"""Time from image to joint state in the live graph, stage by stage: python -m benchmarks.latency BAG --map M --body B.

Needs ROS 2.
"""

import argparse
import os
import sys
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

from rich.box import SIMPLE_HEAD
from rich.progress import Progress
from rich.table import Table

from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.errors import RecordingError
from bodycam_ros.files.whole_file import scratch_folder

if TYPE_CHECKING:
    from benchmarks.latency_stages import Latency

_CAMERAS_A_CORE = 2
"""That a core holds in real time; where to begin to look for a rate at which nothing queues."""

_SLOWEST = 0.02


def main() -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("recording", type=Path, metavar="BAG", help="ros2 bag folder or .mcap file with the cameras")
    parser.add_argument("--map", type=Path, required=True, help="reference map, a folder made by 'bodycam map'")
    parser.add_argument("--body", type=Path, required=True, help="body YAML, made by 'bodycam body'")
    parser.add_argument(
        "--cameras", type=_count, nargs="+", default=[4, 8, 16], help="how many cameras to play, the body's first ones"
    )
    parser.add_argument("--delays", type=int, nargs="+", default=[0], help="values of estimator.output_delay")
    parser.add_argument(
        "--rate", type=_rate, default=0.0, help="times the recorded speed; by default as fast as nothing queues"
    )
    parser.add_argument("--registrations", type=_count, default=4, help="nodes that share the registration")
    parser.add_argument("--one-process", action="store_true", help="all nodes in one process, and not in one each")
    return run(parser.parse_args())


@dataclass(frozen=True)
class _Played:
    """One run of the graph."""

    cameras: int
    rate: float
    output_delay: int
    latency: "Latency"
    image_s: float


def run(arguments: argparse.Namespace) -> int:
    """Play the graph at every number of cameras and every delay, and print the table."""
    from bodycam_ros.body.body_file import read_body
    from bodycam_ros.recording.bag_reader import open_recording

    mounts = list(read_body(arguments.body).mounts)
    with open_recording(arguments.recording) as recording:
        there = [camera for camera in mounts if camera in recording.cameras]
        images = max(map(recording.image_count, there), default=0)
        frame_s = recording.duration_s / max(1, images - 1)
    if not there:
        raise RecordingError(f"{arguments.recording}: has no camera of {arguments.body}")
    played: list[_Played] = []
    with Progress(console=Terminal(stderr=True), transient=True) as progress:
        task = progress.add_task("", total=None)
        for count in dict.fromkeys(min(count, len(there)) for count in arguments.cameras):
            rate = arguments.rate or min(1.0, _CAMERAS_A_CORE * (os.cpu_count() or 1) / count)
            for delay in arguments.delays:
                progress.update(task, description=f"{count} cameras, output_delay {delay}")
                played.append(_play(arguments, there[:count], rate, delay, frame_s))
                rate = played[-1].rate
    console = Terminal()
    console.print(_table(played))
    console.print(_explanation(), soft_wrap=True)
    console.print(_cost(played, arguments.one_process), soft_wrap=True)
    return 0


def _play(arguments: argparse.Namespace, cameras: Sequence[str], rate: float, delay: int, frame_s: float) -> _Played:
    """Play at a rate, or without one at the first of it, a half, a quarter ... at which nothing queues."""
    from benchmarks.latency_stages import cost_of_image, latency_of, play_live

    while True:
        with scratch_folder(Path(tempfile.gettempdir())) as scratch:
            inputs = (arguments.recording, arguments.map, arguments.body, scratch)
            noted = play_live(*inputs, cameras, rate, delay, arguments.registrations, arguments.one_process)
        latency = latency_of(chain.from_iterable(noted.values()))
        if not len(latency.stamps_ns):
            raise RecordingError(f"{arguments.recording}: no state was solved; is it too short?")
        if arguments.rate or latency.way_s <= frame_s / rate:
            processes = [list(chain.from_iterable(noted.values()))] if arguments.one_process else noted.values()
            return _Played(len(cameras), rate, delay, latency, cost_of_image(processes))
        if rate < _SLOWEST:
            raise RecordingError(f"{arguments.recording}: images queue even at {rate:g} of its speed; is it too short?")
        rate /= 2


def _table(played: Sequence[_Played]) -> Table:
    import numpy as np

    from benchmarks.latency_stages import STAGES

    columns = ("cams", "rate", "delay", *(stage[:5] for stage in STAGES), "p50", "p95", "p99", "at 1")
    table = Table(*columns, box=SIMPLE_HEAD, padding=(0, 1, 0, 0))
    for each in played:
        totals_s = np.percentile(each.latency.total_s, (50, 95, 99))
        real_time_s = np.median(each.latency.total_in_real_time_s(each.rate))
        table.add_row(
            str(each.cameras),
            f"{each.rate:g}",
            str(each.output_delay),
            *map(_ms, (*np.median(each.latency.stages_s, axis=0), *totals_s, real_time_s)),
        )
    return table


def _count(text: str) -> int:
    if (count := int(text)) < 1:
        raise argparse.ArgumentTypeError("must be at least 1")
    return count


def _rate(text: str) -> float:
    if not 0.0 < (rate := float(text)) <= 1000.0:
        raise argparse.ArgumentTypeError("must be above 0, and 1000 at most")
    return rate


def _ms(seconds: float) -> str:
    return f"{1e3 * seconds:.1f}" if seconds < 0.01 else f"{1e3 * seconds:.0f}"


def _explanation() -> str:
    return (
        f"All in ms on {os.cpu_count()} cores. Stages: medians, of the camera that a state waited for; 'track' "
        "decodes too, 'way' is messages and busy processes, 'later' the wait for later frames (output_delay). Below "
        "rate 1 the recording was played so much slower, so that nothing queues, and 'later' is longer by as much; "
        "'at 1' is the median (p50) without that."
    )


def _cost(played: Sequence[_Played], one_process: bool) -> str:
    runs = ", ".join(f"{1e3 * each.image_s:.1f} ({each.cameras} cameras, delay {each.output_delay})" for each in played)
    where = "one process, player included" if one_process else "all processes, player included"
    return f"processor time of an image, {where} [ms]: {runs}"


if __name__ == "__main__":
    sys.exit(main())
