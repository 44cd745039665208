"""Cameras that are wrong must be named: another lens, two exchanged, a strap that slipped."""

import re
import sys
from collections.abc import Iterator
from pathlib import Path

from benchmarks.figures import disturbance
from benchmarks.figures.bench import Bench, verdict
from benchmarks.figures.command import Ran, run
from benchmarks.figures.figure import Figure


def wrong_lens(bench: Bench, walk: str) -> Iterator[Figure]:
    """One camera_info has a focal length 8 % too long."""
    bag = disturbance.write_disturbed(
        bench.recording(walk) / "bag", bench.work / "wrong lens", focal={"shin_left": 1.08}
    )
    yield from _named(f"{walk}, wrong lens", bench.replay("wrong lens out", bag, _body(bench, walk)), "shin_left")


def exchanged(bench: Bench, walk: str) -> Iterator[Figure]:
    """Two cameras wear each other's name."""
    names = {"forearm_left": "forearm_right", "forearm_right": "forearm_left"}
    bag = disturbance.write_disturbed(bench.recording(walk) / "bag", bench.work / "exchanged", renamed=names)
    ran = bench.replay("exchanged out", bag, _body(bench, walk))
    yield from _named(f"{walk}, exchanged cameras", ran, "forearm_left", "forearm_right")


def slipped(bench: Bench, walk: str) -> Iterator[Figure]:
    """A strap slipped by 10 cm after the calibration."""
    body = disturbance.write_slipped(_body(bench, walk), bench.work / "slipped.yaml", "thigh_left", 0.10)
    ran = bench.replay("slipped out", bench.recording(walk) / "bag", body)
    yield from _named(f"{walk}, slipped strap", ran, "thigh_left")


def wrong_registrations(bench: Bench) -> Iterator[Figure]:
    """States that are wrong where registrations of 17 cameras are, by chance or in bursts."""
    printed = run([sys.executable, "-m", "benchmarks.wrong_registrations", "--body", str(bench.body("sample"))]).output
    for case, wrong, p99_cm in re.findall(
        r"^(.+?): (\d+) of \d+ states wrong, .* p99 ([\d.]+) cm", printed, re.MULTILINE
    ):
        yield Figure(f"registrations, {case}: states that are wrong", int(wrong))
        yield Figure(f"registrations, {case}: worst segment, 99th percentile [cm]", float(p99_cm))


def _named(group: str, ran: Ran, *cameras: str) -> Iterator[Figure]:
    """Whether the findings name these cameras and no other."""
    findings = [line for line in ran.output.splitlines() if line.startswith(("wrong: ", "doubtful: "))]
    text = "\n".join(findings)
    named = all(camera in text for camera in cameras)
    yield Figure(f"{group}: camera named", "yes" if named and findings else "no")
    yield Figure(f"{group}: verdict", verdict(ran))


def _body(bench: Bench, walk: str) -> Path:
    return bench.body("sample" if walk == "sample" else "dev_rom")
