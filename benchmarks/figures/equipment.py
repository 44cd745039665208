"""A cyclist with the supplied bicycle: feet on the pedals, the crank, and leg cameras that are gone (B 3.2)."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np
import yaml

from benchmarks.figures import disturbance
from benchmarks.figures.bench import Bench, errors
from benchmarks.figures.disturbance import GONE
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import Score, score

HALF = ("thigh_left", "foot_left", "shin_right")
LEGS = tuple(f"{segment}_{side}" for segment in ("thigh", "shin", "foot") for side in ("left", "right"))
DARK_S = (1.5, 3.0)


def bicycle(bench: Bench) -> Iterator[Figure]:
    """All cameras see."""
    group = "dev_cycle with bicycle"
    bench.replay(group, bench.recording("dev_cycle") / "bag", bench.body(), "--equipment", "bicycle")
    scored = score(bench.out(group), bench.recording("dev_cycle"))
    yield from errors(group, scored)
    yield from feet_on_pedals(group, scored, bench.recording("dev_cycle"))
    known = np.loadtxt(bench.recording("dev_cycle") / "truth/pedals.csv", delimiter=",", skiprows=1)
    crank = scored.link("crank")
    off = np.arctan2(-crank[:, 2, 0], crank[:, 0, 0]) - np.interp(scored.seconds, known[:, 0], known[:, 1])
    off_deg = np.degrees((off + np.pi) % (2.0 * np.pi) - np.pi)
    yield Figure(f"{group}: crank angle, mean [deg]", float(np.abs(off_deg).mean()))


def without_leg_cameras(bench: Bench) -> Iterator[Figure]:
    """Half of the leg cameras are gone; all six are dark for 1.5 s; all six are gone."""
    for what, cameras, (start_s, end_s), delays in (
        ("half of the leg cameras", HALF, (0.0, 99.0), ("4",)),
        ("leg cameras for 1.5 s", LEGS, DARK_S, ("4", "offline")),
        ("leg cameras", LEGS, (0.0, 99.0), ("4", "offline")),
    ):
        gone = disturbance.during(cameras, start_s, end_s, GONE)
        bag = disturbance.write_disturbed(bench.recording("dev_cycle") / "bag", bench.work / f"no {what}", gone)
        for delay in delays:
            group = f"dev_cycle with bicycle, without {what}, delay {delay}"
            flags = ("--equipment", "bicycle", "--estimator.output_delay", delay)
            bench.replay(group, bag, bench.body(), *flags)
            scored = score(bench.out(group), bench.recording("dev_cycle"))
            yield from _legs(group, scored, (start_s, end_s), LEGS)


def _legs(group: str, scored: Score, span_s: tuple[float, float], legs: Sequence[str]) -> Iterator[Figure]:
    rows = scored.within(*span_s)
    position = np.stack([scored.position_cm[name][rows] for name in legs])
    rotation = np.stack([scored.rotation_deg[name][rows] for name in legs])
    yield Figure(f"{group}: leg joint position, mean [cm]", float(position.mean()))
    yield Figure(f"{group}: leg joint rotation, mean [deg]", float(rotation.mean()))


def feet_on_pedals(group: str, scored: Score, recording: Path) -> Iterator[Figure]:
    """Distance of the ball of each foot from the true pedal (B figure 8)."""
    ball = np.append(yaml.safe_load((recording / "equipment.yaml").read_text())["pedal_point_in_foot"], 1.0)
    known = np.loadtxt(recording / "truth/pedals.csv", delimiter=",", skiprows=1)
    for side, first in (("left", 2), ("right", 5)):
        pedal = np.column_stack([np.interp(scored.seconds, known[:, 0], known[:, first + k]) for k in range(3)])
        path = (scored.link(f"foot_{side}") @ ball)[:, :3]
        yield Figure(
            f"{group}: {side} foot to pedal, mean [mm]", 1e3 * float(np.linalg.norm(path - pedal, axis=1).mean())
        )
