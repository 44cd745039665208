"""A person before static cameras, no camera on the body (B 2), rendered."""

from collections.abc import Iterator

from benchmarks.figures.bench import Bench, errors, verdict
from benchmarks.figures.command import Ran
from benchmarks.figures.equipment import feet_on_pedals
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import score


def rendered(bench: Bench, name: str, surface: str) -> Iterator[Figure]:
    """A rendered recording, with the scan of each segment or with capsules."""
    group = f"{name}, {surface}"
    ran = _replay(bench, group, name, surface)
    yield from errors(group, score(bench.out(group), bench.recording(name)))
    yield Figure(f"{group}: verdict", verdict(ran))


def rider(bench: Bench) -> Iterator[Figure]:
    """The cyclist, with the bicycle."""
    group, name = "dev_outside_cycle with bicycle, scan", "dev_outside_cycle"
    _replay(bench, group, name, "scan", "--equipment", "bicycle")
    scored = score(bench.out(group), bench.recording(name))
    yield from errors(group, scored)
    yield from feet_on_pedals(group, scored, bench.recording(name))


def _replay(bench: Bench, group: str, name: str, surface: str, *flags: object) -> Ran:
    recording = bench.recording(name)
    placed = ("--stations", recording / "external/cameras.yaml", "--start", recording / "external/start.yaml")
    scan = ("--surface", recording / "body") if surface == "scan" else ()
    return bench.replay(group, recording / "bag", bench.body(), *placed, *scan, *flags)
