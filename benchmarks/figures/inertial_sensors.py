"""Cameras without images whose inertial sensors go on: the rows of blind cameras, with sensors (issue 27)."""

from collections.abc import Collection, Iterator
from pathlib import Path

import numpy as np

from benchmarks.disturb_recording import blur_bag
from benchmarks.figures import disturbance
from benchmarks.figures.bench import Bench, errors
from benchmarks.figures.command import bodycam
from benchmarks.figures.disturbance import GONE, GREY, LEFT_ARM, LEFT_LEG, Disturbance
from benchmarks.figures.equipment import DARK_S, LEGS
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import score
from bodycam_ros.geometry import umeyama

Span = tuple[float, float] | None


def sensors(bench: Bench) -> Iterator[Figure]:
    """All of them, from the range of motion to the score."""
    leg = disturbance.during((*LEFT_LEG, "thigh_right"), 2.0, 4.0, GONE)
    arm = disturbance.during(LEFT_ARM, 1.0, 5.5, GREY)
    yield from _row(bench, "dev_walk", "as it is", None, None, None, ("4",))
    yield from _row(bench, "dev_walk", "five images a second", disturbance.every_sixth, None, None, ("4",))
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


def blur(bench: Bench) -> Iterator[Figure]:
    """Images exposed for 15 ms, 0.45 of their interval, for two seconds: with sensors and without."""
    recording, span_s = bench.recording("dev_walk"), (2.0, 4.0)
    bag = bench.work / "dev_walk blurred"
    blur_bag(recording / "bag", bag, 0.45, *span_s)
    for how, body, flags in (
        ("without sensors", bench.body(), ()),
        ("with sensors", bench.body_with_sensors(), ("--imu", recording / "imu")),
    ):
        group = f"dev_walk, blur of 15 ms for 2 s, {how}"
        bench.replay(group, bag, body, *flags)
        scored = score(bench.out(group), recording, span_s)
        rows = scored.within(*span_s)
        position, rotation = (np.stack(list(e.values()))[:, rows] for e in (scored.position_cm, scored.rotation_deg))
        yield Figure(f"{group}: images registered [%]", 100.0 * scored.result.registered)
        yield Figure(f"{group}: joint position, mean [cm]", float(position.mean()))
        yield Figure(f"{group}: joint rotation, mean [deg]", float(rotation.mean()))


def map_without_board(bench: Bench) -> Iterator[Figure]:
    """Map and body of the range of motion, whose scale and vertical accelerometers give; then the walk."""
    rom, walk = bench.recording("dev_rom"), bench.recording("dev_walk")
    group = "dev_walk, map from the range of motion by accelerometers"
    folder, body = bench.work / "map by accelerometers", bench.work / "body in map by accelerometers.yaml"
    given = ("--rig", rom / "rig.yaml", "--jobs", bench.jobs, "--imu", rom / "imu")
    bodycam("map", "--from-bag", rom / "bag", *given, "--no-board", "-o", folder)
    bodycam("body", rom / "bag", *given, "--map", folder, "-o", body)
    bench.replay(group, walk / "bag", body, "--imu", walk / "imu", in_map=folder)
    scored = score(bench.out(group), walk)
    joints = np.concatenate([scored.result.links[name][:, :3, 3] for name in scored.segments])
    true = np.concatenate([scored.truth.at(scored.seconds, name)[0] for name in scored.segments])
    yield Figure(f"{group}: scale off [%]", 100.0 * abs(umeyama(joints, true, with_scale=True)[0] - 1.0))
    tilt = np.arccos(np.clip(scored.truth_T_world[2, 2], -1.0, 1.0))
    yield Figure(f"{group}: vertical off [deg]", float(np.degrees(tilt)))
    yield from errors(group, scored)


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
        given = ("--imu", recording / "imu", "--estimator.output_delay", delay, *flags)
        bench.replay(group, bag, bench.body_with_sensors(), *given)
        scored = score(bench.out(group), recording, span_s)
        rows = slice(None) if span_s is None else scored.within(*span_s)
        names = limb or scored.segments
        position = np.stack([scored.position_cm[each][rows] for each in names])
        rotation = np.stack([scored.rotation_deg[each][rows] for each in names if each in scored.rotation_deg])
        yield Figure(f"{group}: joint position, mean [cm]", float(position.mean()))
        yield Figure(f"{group}: joint rotation, mean [deg]", float(rotation.mean()))
        yield Figure(f"{group}: joint rotation, max [deg]", float(rotation.max()))
