"""What it costs: a replay as a whole process, an image by stage, a state, the start of the live graph."""

from collections.abc import Iterator

from benchmarks.figures.bench import Bench
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import Result


def whole_process(bench: Bench, walk: str) -> Iterator[Figure]:
    """A replay from the start of the interpreter to its end, with all cores, nothing beside it."""
    group = f"replay of {walk} as a process"
    ran = bench.replay(group, bench.recording(walk) / "bag", bench.body("sample" if walk == "sample" else "dev_rom"))
    seconds = Result.read(bench.out(group)).seconds
    yield Figure(f"{group}: recorded time over wall time", float(seconds[-1] - seconds[0]) / ran.wall_s)
    yield Figure(f"{group}: CPU time [s]", ran.cpu_s)
    yield Figure(f"{group}: peak memory [MB]", ran.peak_mb)
