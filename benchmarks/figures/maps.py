"""Maps: from photographs, from the body's own cameras, and maps that show half of the place."""

import csv
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pycolmap

from benchmarks.euroc_against_colmap import compare
from benchmarks.figures.bench import Bench, errors
from benchmarks.figures.command import bodycam
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import rigid_fit, score
from benchmarks.half_map import half_map
from bodycam_ros.registration.reference_map import ReferenceMap

_HALVES = {"north": 90.0, "south": -90.0}
"""Azimuth that the photographs of each half look to, within 90 degrees [deg]."""


def photographs(bench: Bench) -> Iterator[Figure]:
    """The map of 110 photographs with the board on the floor."""
    ran = bodycam("map", bench.recording("dev_hall") / "reference", "-o", bench.work / "hall", "--jobs", bench.jobs)
    found = _centres(bench.work / "hall")
    with (bench.recording("dev_hall") / "truth/reference_poses.csv").open() as file:
        true = {row["file"]: np.array([float(row[axis]) for axis in "xyz"]) for row in csv.DictReader(file)}
    ours, theirs = (np.array([centres[name] for name in found]) for centres in (found, true))
    R, t = rigid_fit(ours, theirs)
    yield Figure("map of 110 photographs: cameras registered", float(len(found)))
    yield Figure("map of 110 photographs: camera centre, mean [mm]", 1e3 * _mean_distance(ours @ R.T + t, theirs))
    scale = np.linalg.norm(ours - ours.mean(axis=0)) / np.linalg.norm(theirs - theirs.mean(axis=0))
    yield Figure("map of 110 photographs: scale off [%]", 100.0 * abs(float(scale) - 1.0))
    yield Figure("map of 110 photographs: wall time [s]", ran.wall_s)
    yield Figure("map of 110 photographs: CPU time [s]", ran.cpu_s)


def half(bench: Bench, walk: str, which: str, passes: int) -> Iterator[Figure]:
    """Half of the map, extended in one pass or in three."""
    group = f"{walk}, {which} half of the map, passes {passes}"
    folder = bench.work / f"{group} map"
    half_map(ReferenceMap.load(bench.map), _HALVES[which]).save(folder)
    bag, body = bench.recording(walk) / "bag", bench.body("sample" if walk == "sample" else "dev_rom")
    bench.replay(group, bag, body, "--passes", passes, in_map=folder)
    scored = score(bench.out(group), bench.recording(walk))
    yield from errors(group, scored)
    yield Figure(f"{group}: images registered [%]", 100.0 * scored.result.registered)


def body_cameras_alone(bench: Bench) -> Iterator[Figure]:
    """No photographs: map and body from the range of motion, then the walk."""
    rom, group = bench.recording("dev_rom"), "dev_walk, map from the range of motion"
    folder, body = bench.work / "map of rom", bench.work / "body in map of rom.yaml"
    given = ("--rig", rom / "rig.yaml", "--jobs", bench.jobs)
    bodycam("map", "--from-bag", rom / "bag", *given, "--board", rom / "board.yaml", "-o", folder)
    bodycam("body", rom / "bag", *given, "--map", folder, "-o", body)
    bench.replay(group, bench.recording("dev_walk") / "bag", body, in_map=folder)
    yield from errors(group, score(bench.out(group), bench.recording("dev_walk")))


def euroc(bench: Bench) -> Iterator[Figure]:
    """Real photographs of a flying rig, half of them registered in a map of the others, beside COLMAP."""
    assert bench.shared is not None
    scratch = bench.work / "euroc"
    scratch.mkdir()
    found = compare(bench.shared / "real/euroc_v101", scratch)
    group = "EuRoC V1_01"
    yield Figure(f"{group}: images registered [%]", 100.0 * len(found.ours.poses) / found.asked)
    yield Figure(f"{group}: camera centre, median [cm]", 100.0 * float(np.median(found.our_errors)))
    yield Figure(f"{group}: camera centre of COLMAP, median [cm]", 100.0 * float(np.median(found.colmap_errors)))
    yield Figure(f"{group}: CPU time over COLMAP's", found.ours.seconds / found.colmap.seconds)


def _centres(folder: Path) -> dict[str, np.ndarray]:
    """Name of the image -> centre of its camera (3,) [m], read by COLMAP itself."""
    model = pycolmap.Reconstruction(folder / "sparse")
    return {image.name: image.projection_center() for image in model.images.values() if image.has_pose}


def _mean_distance(a: np.ndarray, b: np.ndarray) -> float:
    return float(np.linalg.norm(a - b, axis=1).mean())
