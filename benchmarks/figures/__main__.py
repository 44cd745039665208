"""The table that nothing may worsen: python -m benchmarks.figures [--quick] [--only PATTERN ...] [--write-page].

All recordings beside the repository (../shared) are measured, or where they are missing the sample in bags/. The table
is printed beside the run before; out/figures/figures.json has it, figures.before.json the run before. Exit code 1
where a limit is broken (``limits.yaml``).
"""

import argparse
import os
import shutil
import subprocess
import sys
import tempfile
import time
import traceback
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor, as_completed
from dataclasses import dataclass, replace
from fnmatch import fnmatch
from functools import partial
from pathlib import Path

from rich.console import Console
from rich.progress import Progress

from benchmarks.figures import (
    blind_cameras,
    equipment,
    faulty_cameras,
    inertial_sensors,
    maps,
    real_person,
    recorded_motion,
    speed,
    static_cameras,
    unnamed_errors,
)
from benchmarks.figures.bench import REPOSITORY, Bench
from benchmarks.figures.figure import Figure, read_limits
from benchmarks.figures.table import Run, broken, page, read_run, shown

OUT = REPOSITORY / "out/figures"
PAGE = REPOSITORY / "docs/figures.md"


@dataclass(frozen=True)
class Measurement:
    """What yields some figures.

    Attributes:
        name: for people and ``--only``.
        measure: does it.
        alone: whether it measures time, so that nothing may run beside it.
    """

    name: str
    measure: Callable[[Bench], Iterable[Figure]]
    alone: bool = False


def measurements(mode: str) -> Iterator[Measurement]:
    """All of a mode, in the order of the table: ``full``, ``quick``, or ``sample`` where ../shared is missing."""
    walk = "sample" if mode == "sample" else "dev_walk"
    if mode == "full":
        yield Measurement("photographs", maps.photographs, alone=True)
    yield Measurement("speed", partial(speed.whole_process, walk=walk), alone=True)
    yield Measurement("stages", speed.stages, alone=True)
    for way in ("separate", "one") if mode == "full" else ("one",):
        yield Measurement(f"start {way}", partial(speed.start_of_graph, way=way), alone=True)
    if mode == "full":
        yield Measurement("euroc", maps.euroc, alone=True)
    for name in {"full": ("dev_walk", "dev_rom", "dev_cycle"), "quick": ("dev_walk",), "sample": ("sample",)}[mode]:
        yield Measurement(name, partial(recorded_motion.recording, name=name))
    if mode != "sample":
        yield Measurement("bones", partial(recorded_motion.bones, name="dev_rom"))
    if mode == "full":
        yield Measurement("ordinary cameras", recorded_motion.ordinary_cameras)
        yield Measurement("worn footage", recorded_motion.worn_footage)
        for which, passes in (("north", 1), ("north", 3), ("south", 1), ("south", 3)):
            yield Measurement(f"half map {which} {passes}", partial(maps.half, walk=walk, which=which, passes=passes))
        yield Measurement("map from body cameras", maps.body_cameras_alone)
    spans = {"sample": ((0.5, 1.5), (0.5, 1.5), (0.8, 1.3))}.get(mode, ((2.0, 4.0), (1.0, 5.5), (2.0, 2.5)))
    for blind, (start_s, end_s) in zip(
        (blind_cameras.leg, blind_cameras.arm, blind_cameras.silence), spans, strict=True
    ):
        if mode != "quick" or blind is blind_cameras.leg:
            measure = partial(blind, walk=walk, start_s=start_s, end_s=end_s)
            yield Measurement(f"blind {blind.__name__}", measure)
    if mode == "full":
        yield Measurement("every third image", partial(blind_cameras.every_third, walk=walk))
        yield Measurement("quarter dark", partial(blind_cameras.quarter, walk=walk))
        yield Measurement("bicycle", equipment.bicycle)
        yield Measurement("legs gone", equipment.without_leg_cameras)
        yield Measurement("inertial sensors", inertial_sensors.sensors)
        yield Measurement("sensors and blur", inertial_sensors.blur)
        yield Measurement("sensors and map", inertial_sensors.map_without_board)
        for name in ("dev_outside_cycle", "dev_outside_board"):
            for surface in ("scan", "capsules"):
                yield Measurement(f"{name} {surface}", partial(static_cameras.rendered, name=name, surface=surface))
            yield Measurement(f"{name} starts", partial(unnamed_errors.unnamed_errors, name=name))
        yield Measurement("pose2sim starts", unnamed_errors.pose2sim)
        yield Measurement("five static cameras", unnamed_errors.five_cameras)
        yield Measurement("static cameras and bicycle", static_cameras.rider)
        yield Measurement("pose2sim", real_person.pose2sim)
        yield Measurement("wrong lens", partial(faulty_cameras.wrong_lens, walk=walk))
        yield Measurement("slipped strap", partial(faulty_cameras.slipped, walk=walk))
        yield Measurement("wrong registrations", faulty_cameras.wrong_registrations)
    yield Measurement("exchanged cameras", partial(faulty_cameras.exchanged, walk=walk))


def main() -> int:
    """Measure, print and write the table."""
    parser = argparse.ArgumentParser(prog="benchmarks.figures", description=__doc__)
    parser.add_argument("--quick", action="store_true", help="the rows that change most, in 3 minutes")
    parser.add_argument("--sample", action="store_true", help="only what the repository carries, as without ../shared")
    parser.add_argument(
        "--only", metavar="PATTERN", nargs="+", default=["*"], help="measurements whose name matches one, as 'blind*'"
    )
    parser.add_argument("--write-page", action="store_true", help="write docs/figures.md; for a full run")
    parser.add_argument("--keep", type=Path, metavar="DIR", help="keep the results in this folder")
    arguments = parser.parse_args()
    shared = REPOSITORY.parent / "shared"
    shared_or_none = shared if (shared / "recordings").is_dir() and not arguments.sample else None
    mode = "sample" if shared_or_none is None else "quick" if arguments.quick else "full"
    if arguments.write_page and (mode != "full" or arguments.only != ["*"]):
        parser.error("--write-page needs all rows: ../shared beside the repository, no --quick and no --only")
    asked = [each for each in measurements(mode) if any(fnmatch(each.name, only) for only in arguments.only)]
    began_s, load = time.perf_counter(), os.getloadavg()[0]
    with tempfile.TemporaryDirectory(prefix="figures-") as folder:
        work = arguments.keep or Path(folder)
        work.mkdir(parents=True, exist_ok=True)
        found = list(_measured(asked, Bench(work, shared_or_none)))
    run = Run(
        _commit(), mode, os.cpu_count() or 1, load, time.perf_counter() - began_s, {f.name: f.value for f in found}
    )
    limits = read_limits()
    OUT.mkdir(parents=True, exist_ok=True)
    file, before = OUT / "figures.json", OUT / "figures.before.json"
    if file.is_file():
        shutil.copy(file, before)
    Console(width=None if sys.stdout.isatty() else 160).print(shown(run, read_run(before), limits))
    run.write(file)
    if arguments.write_page:
        PAGE.write_text(page(run, limits))
    for name in (failing := broken(found, limits)):
        print(f"limit broken: {name}", file=sys.stderr)
    return 1 if failing else 0


def _measured(asked: Iterable[Measurement], bench: Bench) -> Iterator[Figure]:
    """Figures in the order of the table: what measures time alone, then the rest, as many at a time as cores."""
    asked = list(asked)
    results: dict[str, list[Figure]] = {}
    with Progress(transient=True) as progress:
        task = progress.add_task("figures", total=len(asked))
        for each in asked:
            if each.alone:
                progress.update(task, description=each.name)
                results[each.name] = _of(each, bench)
                progress.advance(task)
        if any(not each.alone for each in asked) and bench.shared is not None:
            bench.body()  # with all cores: nearly everything waits for it
        at_once = replace(bench, jobs=1)
        with ThreadPoolExecutor(os.cpu_count()) as pool:
            futures = {pool.submit(_of, each, at_once): each for each in asked if not each.alone}
            for future in as_completed(futures):
                results[futures[future].name] = future.result()
                progress.update(task, advance=1, description=futures[future].name)
    for each in asked:
        yield from results[each.name]


def _of(measurement: Measurement, bench: Bench) -> list[Figure]:
    """The figures; a measurement that fails is one figure that failed, and the others go on."""
    figures = []
    try:
        for figure in measurement.measure(bench):
            figures.append(figure)
    except Exception:
        traceback.print_exc()
        figures.append(Figure(f"{measurement.name}: failed", float("nan")))
    return figures


def _commit() -> str:
    def git(*arguments: str) -> str:
        return subprocess.run(["git", *arguments], cwd=REPOSITORY, capture_output=True, text=True).stdout.strip()

    return (git("rev-parse", "--short", "HEAD") or "unknown") + ("+" if git("status", "--porcelain", "-uno") else "")


if __name__ == "__main__":
    sys.exit(main())
