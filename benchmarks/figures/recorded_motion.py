"""Accuracy where cameras see: walk, range of motion, cyclist, and ordinary cameras from their files; bones."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml

from benchmarks.figures.bench import Bench, errors, verdict
from benchmarks.figures.command import bodycam
from benchmarks.figures.figure import Figure
from benchmarks.figures.score import score
from benchmarks.worn_footage import write_worn_footage


def recording(bench: Bench, name: str) -> Iterator[Figure]:
    """A recording of triggered cameras, with the body of its range of motion."""
    ran = bench.replay(name, bench.recording(name) / "bag", bench.body("sample" if name == "sample" else "dev_rom"))
    yield from errors(name, score(bench.out(name), bench.recording(name)))
    yield Figure(f"{name}: verdict", verdict(ran))


def worn_footage(bench: Bench) -> Iterator[Figure]:
    """Range of motion and walk behind swinging cloth, with exposure in jumps, a smear, noise and strong compression."""
    bags = {
        name: write_worn_footage(bench.recording(name) / "bag", bench.work / f"{name} worn")
        for name in ("dev_rom", "dev_walk")
    }
    group = "dev_walk, worn footage"
    ran = bench.replay(group, bags["dev_walk"], bench.body("dev_rom", bags["dev_rom"]))
    yield from errors(group, score(bench.out(group), bench.recording("dev_walk")))
    yield Figure(f"{group}: verdict", verdict(ran))


def bones(bench: Bench, name: str, body: Path | None = None) -> Iterator[Figure]:
    """Lengths of the body's bones against the true ones."""
    off_mm = _bone_errors(body or bench.body(name), bench.recording(name) / "truth/skeleton.yaml")
    yield Figure(f"{name}: bone length, mean [mm]", float(np.mean(off_mm)))
    yield Figure(f"{name}: bone length, max [mm]", float(np.max(off_mm)))


def ordinary_cameras(bench: Bench) -> Iterator[Figure]:
    """Files of cameras that were started by hand: files in, body and score out."""
    for name in ("dev_gopro_rom", "dev_gopro_walk"):
        bodycam("ingest", bench.recording(name) / "mp4", "-o", bench.work / f"{name}.bag", "--jobs", bench.jobs)
    body = bench.body("dev_gopro_rom", bench.work / "dev_gopro_rom.bag")
    yield from bones(bench, "dev_gopro_rom", body)
    yield from _walk_from_files(bench, "dev_gopro_walk", body)
    # Its read-out times are those of another camera's video mode.
    yield from _walk_from_files(bench, "dev_gopro_walk, body of dev_rom", bench.body("dev_rom"))


def _walk_from_files(bench: Bench, group: str, body: Path) -> Iterator[Figure]:
    ran = bench.replay(group, bench.work / "dev_gopro_walk.bag", body)
    scored = score(bench.out(group), bench.recording("dev_gopro_walk"), own_clock=True)
    # Before the first and after the last clap nothing is recorded, so coverage by the truth's frames means little.
    yield from (figure for figure in errors(group, scored) if "coverage" not in figure.name)
    yield Figure(f"{group}: verdict", verdict(ran))


def _bone_errors(body: Path, skeleton: Path) -> list[float]:
    """Differences [mm]: a segment's joints from the joint above it, or from each other on the topmost segment."""
    ours = {name: joint["origin_in_parent"] for name, joint in yaml.safe_load(body.read_text())["joints"].items()}
    joints = yaml.safe_load(skeleton.read_text())
    theirs = {name: joint["offset_in_parent"] for name, joint in joints.items()}
    above = {name: joint["parent"] for name, joint in joints.items() if name in ours}
    root = next(parent for parent in above.values() if parent not in {joint["child"] for joint in joints.values()})
    off_mm = []
    for name, parent in above.items():
        if parent != root:
            off_mm.append(1e3 * abs(float(np.linalg.norm(ours[name]) - np.linalg.norm(theirs[name]))))
    left, right = "hip_left", "hip_right"
    apart = [float(np.linalg.norm(np.subtract(offsets[left], offsets[right]))) for offsets in (ours, theirs)]
    return [*off_mm, 1e3 * abs(apart[0] - apart[1])]
