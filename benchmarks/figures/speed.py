"""What it costs: a replay as a whole process, an image by stage, a state, the start of the live graph."""

import json
import re
import sys
from collections.abc import Iterator

from benchmarks.figures.bench import Bench
from benchmarks.figures.command import run
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import Result


def whole_process(bench: Bench, walk: str) -> Iterator[Figure]:
    """A replay from the start of the interpreter to its end, with all cores, nothing beside it."""
    group = f"replay of {walk} as a process"
    ran = bench.replay(group, bench.recording(walk) / "bag", bench.body("sample"))
    seconds = Result.read(bench.out(group)).seconds
    yield Figure(f"{group}: recorded time over wall time", float(seconds[-1] - seconds[0]) / ran.wall_s)
    yield Figure(f"{group}: CPU time [s]", ran.cpu_s)
    yield Figure(f"{group}: peak memory [MB]", ran.peak_mb)


def stages(bench: Bench) -> Iterator[Figure]:
    """CPU time on one thread, of the repository's sample."""
    given = (bench.recording("sample") / "bag", "--map", bench.map, "--body", bench.body("sample"))
    printed = run([sys.executable, "-m", "benchmarks.stage_timing", *map(str, given)]).output
    for stage, milliseconds in re.findall(r"^(\w+) +([\d.]+) ms an image", printed, re.MULTILINE):
        yield Figure(f"one thread: {stage}, an image [ms]", float(milliseconds))
    median, p99 = re.findall(r"^solve +([\d.]+) ms a state \(median\), ([\d.]+)", printed, re.MULTILINE)[0]
    yield Figure("one thread: solve, a state, median [ms]", float(median))
    yield Figure("one thread: solve, a state, p99 [ms]", float(p99))


def start_of_graph(bench: Bench, way: str) -> Iterator[Figure]:
    """The live graph of 16 cameras until every node is active, as ``benchmarks.start_up`` starts it."""
    measured = json.loads(run([sys.executable, "-m", "benchmarks.start_up", "--ways", way]).output.splitlines()[-1])
    group = f"live graph of 16 cameras, {'one process' if way == 'one' else 'a process for each node'}"
    yield Figure(f"{group}: until all nodes are active [s]", measured["active_s"])
    yield Figure(f"{group}: memory [MB]", measured["memory_mb"])
    yield Figure(f"{group}: processes that ended with an error", measured["failed"])
