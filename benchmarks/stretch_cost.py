"""What stretches of a recording cost: python -m benchmarks.stretch_cost BAG --map MAP --body BODY.yaml.

Each stretch is solved in a process of its own, whose seconds of processor time count, not those of the clock: other
work on the computer matters little. What an hour takes with some number of processes is computed from the measured
steps: stretches go to the process that is free first.
"""

import argparse
import multiprocessing
import resource
import time
from collections.abc import Callable, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import cv2
import numpy as np

from bodycam_ros.body.body_file import read_body
from bodycam_ros.quality.camera_poses import CameraPoseLog
from bodycam_ros.recording.bag_records import read_bag_records
from bodycam_ros.replaying.first_pass import BLOCK_S, SAMPLED_SHARE, FirstPass
from bodycam_ros.replaying.make_first_pass import make_first_pass
from bodycam_ros.replaying.merge import merge_stretches
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.replaying.stretch_file import read_stretch

_HOUR_S = 3600.0


@dataclass(frozen=True)
class Cost:
    """What a process took: processor time [s], largest memory [MB], and seconds of the recording that it solved."""

    cpu_s: float
    memory_mb: float
    solved_s: float


def cost_of(work: Callable[..., object], *arguments: object, solved_s: float = 0.0) -> Cost:
    """What a function takes in a process of its own, start included."""
    with ProcessPoolExecutor(1, multiprocessing.get_context("spawn")) as pool:
        cpu_s, memory_mb = pool.submit(_measured, work, arguments).result()
    return Cost(cpu_s, memory_mb, solved_s)


def _measured(work: Callable[..., object], arguments: Sequence[object]) -> tuple[float, float]:
    cv2.setNumThreads(1)
    work(*arguments)
    used = resource.getrusage(resource.RUSAGE_SELF)
    return used.ru_utime + used.ru_stime, 1e-3 * used.ru_maxrss


def schedule_s(stretch_s: float, count: int, processes: int) -> float:
    """When the last of ``count`` equal stretches is solved [s]."""
    free_s = np.zeros(processes)
    for _ in range(count):
        free_s[np.argmin(free_s)] += stretch_s
    return float(free_s.max())


def main() -> None:
    """Print what the steps cost, and what an hour would take."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("recording", type=Path)
    parser.add_argument("--map", type=Path, required=True)
    parser.add_argument("--body", type=Path, required=True)
    parser.add_argument("--stretches", type=int, default=3, help="two or more")
    parser.add_argument("--block", type=float, default=BLOCK_S, help="seconds")
    arguments = parser.parse_args()
    if arguments.stretches < 2:
        parser.error("--stretches: what each of them costs follows from two or more")
    with TemporaryDirectory() as folder:
        asked = ReplayRequest(arguments.recording, arguments.map, arguments.body, Path(folder, "out"), jobs=2)
        first = make_first_pass(asked, arguments.stretches, arguments.block)
        whole = _solve_each(replace(asked, output=Path(folder, "whole")), replace(first, count=1))[0]
        parts = _solve_each(replace(asked, output=Path(folder, "part")), first)
        paths = [Path(folder, f"part{number}") for number in range(first.count)]
        started_s = time.process_time()
        merge_stretches(asked, first, paths)
        merge_s = time.process_time() - started_s
        started_s = time.process_time()
        log = CameraPoseLog(read_body(asked.body), {}, 0.0)
        for path in paths:
            poses = read_stretch(path, read_bag_records(path)).poses
            log.extend(replace(poses, lenses={}))
        read_s = time.process_time() - started_s
    _print_costs(whole, parts, merge_s, read_s)


def _solve_each(asked: ReplayRequest, first: FirstPass) -> list[Cost]:
    costs = []
    for number in range(first.count):
        begin_ns, end_ns = first.stretch_ns(number)
        output = asked.output if first.count == 1 else asked.output.with_name(f"{asked.output.name}{number}")
        request = replace(asked, first=first, stretch=number, output=output)
        costs.append(cost_of(replay, request, solved_s=1e-9 * (end_ns - begin_ns)))
        print(f"stretch {number + 1} of {first.count}, {costs[-1].solved_s:.1f} s: {costs[-1].cpu_s:.1f} s, "
              f"{costs[-1].memory_mb:.0f} MB", flush=True)  # fmt: skip
    return costs


def _print_costs(whole: Cost, parts: Sequence[Cost], merge_s: float, read_s: float) -> None:
    """What was measured, and what follows for an hour; ``read_s``: of the merge, what grows with the recording."""
    together_s = sum(part.cpu_s for part in parts)
    print(f"in one go {whole.cpu_s:.1f} s; {len(parts)} stretches {together_s:.1f} s; merge {merge_s:.2f} s")
    # Seconds of a stretch: what each begins with, and what a second of the recording takes.
    of_each_s = (together_s - whole.cpu_s) / (len(parts) - 1)
    of_second_s = (whole.cpu_s - of_each_s) / whole.solved_s
    hour_s = of_second_s * _HOUR_S
    print(
        f"each stretch {of_each_s:.1f} s + {of_second_s:.2f} s for each second of the recording; an hour {hour_s:.0f} s"
    )
    for processes in (8, 64):
        first_s = SAMPLED_SHARE * hour_s / min(processes, 16)
        count = processes
        stretches_s = schedule_s(of_each_s + of_second_s * _HOUR_S / count, count, processes)
        merged_s = merge_s - read_s + read_s / sum(part.solved_s for part in parts) * _HOUR_S
        needed_s = first_s + stretches_s + merged_s
        print(
            f"{processes} processes: {needed_s:.0f} s (first pass {first_s:.0f}, stretches {stretches_s:.0f}, merge "
            f"{merged_s:.0f}), {hour_s / processes / needed_s:.2f} of linear"
        )


if __name__ == "__main__":
    main()
