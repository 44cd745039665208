"""Cameras without images, for a while or now and then: what the body does that nobody sees."""

from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from benchmarks.figures import disturbance
from benchmarks.figures.bench import Bench, errors
from benchmarks.figures.disturbance import GONE, GREY, LEFT_ARM, LEFT_LEG, Disturbance
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import score

WHEN = ("0", "4", "offline")
"""Frames that a state waits for (``estimator.output_delay``)."""


def leg(bench: Bench, walk: str, start_s: float = 2.0, end_s: float = 4.0) -> Iterator[Figure]:
    """No image of the left leg's cameras and the right thigh's for 2 s."""
    gone = disturbance.during((*LEFT_LEG, "thigh_right"), start_s, end_s, GONE)
    yield from _limb(bench, walk, "left leg without images", gone, LEFT_LEG, (start_s, end_s))


def arm(bench: Bench, walk: str, start_s: float = 1.0, end_s: float = 5.5) -> Iterator[Figure]:
    """Grey images of the left arm's cameras for 4.5 s, as behind a coat."""
    grey = disturbance.during(LEFT_ARM, start_s, end_s, GREY)
    yield from _limb(bench, walk, "left arm grey", grey, LEFT_ARM, (start_s, end_s))


def silence(bench: Bench, walk: str, start_s: float = 2.0, end_s: float = 2.5) -> Iterator[Figure]:
    """No image of any camera for half a second."""
    gone = disturbance.during(None, start_s, end_s, GONE)
    yield from _limb(bench, walk, f"no images for {end_s - start_s:g} s", gone, None, (start_s, end_s))


def every_third(bench: Bench, walk: str) -> Iterator[Figure]:
    """Ten images a second."""
    bag = disturbance.write_disturbed(
        bench.recording(walk) / "bag", bench.work / "every third", disturbance.every_third
    )
    group = f"{walk}, every third image"
    bench.replay(group, bag, _body(bench, walk))
    yield from (f for f in errors(group, score(bench.out(group), bench.recording(walk))) if "coverage" not in f.name)


def quarter(bench: Bench, walk: str) -> Iterator[Figure]:
    """Every fourth camera in turn is dark for half a second."""
    source = bench.recording(walk) / "bag"
    in_turn = disturbance.quarter_in_turn(bench.cameras(walk))
    bag = disturbance.write_disturbed(source, bench.work / "quarter dark", in_turn)
    for delay in WHEN:
        group = f"{walk}, a quarter of the cameras dark, delay {delay}"
        bench.replay(group, bag, _body(bench, walk), "--estimator.output_delay", delay)
        yield from _means(group, *_pooled(bench, group, walk, None, None))


def _limb(
    bench: Bench,
    walk: str,
    what: str,
    change: Disturbance,
    limb: Sequence[str] | None,
    disturbed_s: tuple[float, float],
) -> Iterator[Figure]:
    """Errors of a limb (None: of all segments) while it is not seen, for each delay."""
    bag = disturbance.write_disturbed(bench.recording(walk) / "bag", bench.work / what, change)
    for delay in WHEN:
        group = f"{walk}, {what}, delay {delay}"
        bench.replay(group, bag, _body(bench, walk), "--estimator.output_delay", delay)
        yield from _means(group, *_pooled(bench, group, walk, limb, disturbed_s))


def _pooled(
    bench: Bench, group: str, walk: str, limb: Sequence[str] | None, disturbed_s: tuple[float, float] | None
) -> tuple[np.ndarray, np.ndarray]:
    scored = score(bench.out(group), bench.recording(walk), disturbed_s)
    rows = slice(None) if disturbed_s is None else scored.within(*disturbed_s)
    names = limb or scored.segments
    return (
        np.stack([scored.position_cm[name][rows] for name in names]),
        np.stack([scored.rotation_deg[name][rows] for name in names if name in scored.rotation_deg]),
    )


def _means(group: str, position: np.ndarray, rotation: np.ndarray) -> Iterator[Figure]:
    yield Figure(f"{group}: joint position, mean [cm]", float(position.mean()))
    yield Figure(f"{group}: joint rotation, mean [deg]", float(rotation.mean()))
    yield Figure(f"{group}: joint rotation, max [deg]", float(rotation.max()))


def _body(bench: Bench, walk: str) -> Path:
    return bench.body("sample" if walk == "sample" else "dev_rom")
