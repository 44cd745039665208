"""Cameras without images whose inertial sensors go on: the rows of blind cameras, with sensors (issue 27)."""

from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from benchmarks.figures import disturbance
from benchmarks.figures.bench import Bench
from benchmarks.figures.disturbance import GONE, GREY, LEFT_ARM, LEFT_LEG, Disturbance
from benchmarks.figures.equipment import DARK_S, LEGS
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import score

Span = tuple[float, float] | None


def sensors(bench: Bench) -> Iterator[Figure]:
    """All of them, from the range of motion to the score."""
    leg = disturbance.during((*LEFT_LEG, "thigh_right"), 2.0, 4.0, GONE)
    arm = disturbance.during(LEFT_ARM, 1.0, 5.5, GREY)
    yield from _row(bench, "dev_walk", "as it is", None, None, None, ("4",))
    yield from _row(bench, "dev_walk", "left leg without images", leg, (2.0, 4.0), LEFT_LEG, ("0", "4", "offline"))
    yield from _row(bench, "dev_walk", "left arm grey", arm, (1.0, 5.5), LEFT_ARM, ("0", "4", "offline"))
    for end_s in (2.5, 4.0):
        gone = disturbance.during(None, 2.0, end_s, GONE)
        yield from _row(bench, "dev_walk", f"no images for {end_s - 2.0:g} s", gone, (2.0, end_s), None, ("0", "4"))
    quarter = disturbance.quarter_in_turn(bench.cameras("dev_walk"))
    yield from _row(bench, "dev_walk", "a quarter of the cameras dark", quarter, None, None, ("4",))
    legs = disturbance.during(LEGS, *DARK_S, GONE)
    bicycle = ("--equipment", "bicycle")
    yield from _row(bench, "dev_cycle", "bicycle, legs without images for 1.5 s", legs, DARK_S, LEGS, ("4",), bicycle)


def _row(
    bench: Bench,
    name: str,
    what: str,
    change: Disturbance | None,
    span_s: Span,
    limb: Collection[str] | None,
    delays: Collection[str],
    flags: Collection[str] = (),
) -> Iterator[Figure]:
    """Errors of a limb (None: all segments) in a span (None: all states), for each delay."""
    recording = bench.recording(name)
    bag: Path = recording / "bag"
    if change is not None:
        bag = disturbance.write_disturbed(bag, bench.work / f"{name} sensors {what}", change)
    for delay in delays:
        group = f"{name} with inertial sensors, {what}, delay {delay}"
        given = ("--imu", recording / "imu", "--smoother.output_delay", delay, *flags)
        bench.replay(group, bag, bench.body_with_sensors(), *given)
        scored = score(bench.out(group), recording, span_s)
        rows = slice(None) if span_s is None else scored.within(*span_s)
        names = limb or scored.segments
        position = np.stack([scored.position_cm[each][rows] for each in names])
        rotation = np.stack([scored.rotation_deg[each][rows] for each in names if each in scored.rotation_deg])
        yield Figure(f"{group}: joint position, mean [cm]", float(position.mean()))
        yield Figure(f"{group}: joint rotation, mean [deg]", float(rotation.mean()))
        yield Figure(f"{group}: joint rotation, max [deg]", float(rotation.max()))
