"""Large errors that no finding names: a person before static cameras alone, by starts that differ by a millimetre."""

import re
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from benchmarks.figures.bench import Bench
from benchmarks.figures.command import bodycam
from benchmarks.figures.figure import Figure
from benchmarks.figures.real_person import JOINTS, against_markers, write_bag
from benchmarks.figures.score import Result, Score, Truth, score

STARTS = 30
_START_M = 0.001
_FAR_CM, _TURNED_DEG = 15.0, 60.0
_LEFT_OUT, _BEGIN_S, _LONG_S = ((5, 6), (0, 3), (1, 4)), (0.0, 1.0), 3.0  # cameras, and pieces of a recording
_HEIGHT_M = 1.75
_PLACED_M, _PLACED_RAD = 0.017, 0.06  # sigmas of a start, in each axis
_EDGE_S = 0.1  # around a named span: findings round times to a tenth of a second

Mask = NDArray[np.bool_]


def unnamed_errors(bench: Bench, name: str, starts: int = STARTS) -> Iterator[Figure]:
    """Segments in states that are far off, and of these the ones that no finding names; body without a scan."""
    recording, group, counts = bench.recording(name), f"{name}, {starts} starts", []
    for number in range(starts):
        start = moved_start(recording / "external/start.yaml", bench.work / f"{group}.yaml", number)
        flags = ("--stations", recording / "external/cameras.yaml", "--start", start, "--slim", "--force")
        ran = bench.replay(group, recording / "bag", bench.body(), *flags)
        counts.append(large_errors(score(bench.out(group), recording), ran.output))
    yield from _figures(group, counts)


def pose2sim(bench: Bench, starts: int = STARTS) -> Iterator[Figure]:
    """The same of Pose2Sim's man, of whom there are positions alone, after one rigid alignment."""
    assert bench.shared is not None
    demo, group, counts = bench.shared / "real/pose2sim_single", f"pose2sim, {starts} starts", []
    bag = write_bag(demo, bench.work / "pose2sim_starts.bag")
    for number in range(starts):
        start = moved_start(demo / "start.yaml", bench.work / f"{group}.yaml", number)
        flags = ("--stations", demo / "cameras.yaml", "--start", start, "--slim", "--force")
        ran = bench.replay(group, bag, demo / "body.yaml", *flags)
        result = Result.read(bench.out(group))
        off_cm = against_markers(result, demo / "reference.trc")
        seconds = (result.seconds - result.seconds[0])[: len(off_cm)]
        wrong = dict(zip([each for each in JOINTS if each in result.links], (off_cm > _FAR_CM).T, strict=True))
        counts.append(_count(wrong, seconds, ran.output))
    yield from _figures(group, counts)


def five_cameras(bench: Bench) -> Iterator[Figure]:
    """The same of pieces of ``dev_outside_board`` by five of its cameras, with a body measured from outside."""
    recording, stations = bench.recording("dev_outside_board"), "external/cameras.yaml"
    truth, cameras = Truth.read(recording), yaml.safe_load((recording / stations).read_text())
    board = np.array(yaml.safe_load((recording / "truth/board.yaml").read_text())["T_world_board"], float)
    body, start, fewer = (bench.work / f"five_cameras.{name}.yaml" for name in ("body", "start", "cameras"))
    given = ("--stations", recording / stations, "--start", recording / "external/start.yaml", "--height", _HEIGHT_M)
    bodycam("body", recording / "bag", *given, "-o", body, "--force")
    for left_out in _LEFT_OUT:
        kept = [name for number, name in enumerate(sorted(cameras)) if number not in left_out]
        fewer.write_text(yaml.safe_dump({name: cameras[name] for name in kept}))
        for begin_s in _BEGIN_S:
            group = f"dev_outside_board without cameras {left_out[0]} and {left_out[1]}, from {begin_s:.0f} s"
            seed = int(10 * begin_s) + left_out[0]
            start.write_text(yaml.safe_dump(_placed(truth, begin_s, board, seed)))
            piece = ("--from", begin_s, "--to", begin_s + _LONG_S, "--slim", "--force")
            ran = bench.replay(group, recording / "bag", body, "--stations", fewer, "--start", start, *piece)
            far, unnamed = large_errors(score(bench.out(group), recording), ran.output)
            yield Figure(f"{group}: segments over 15 cm or 60 deg off, in all states", far)
            yield Figure(f"{group}: of these without a finding", unnamed)


def _placed(truth: Truth, begin_s: float, world_T_board: NDArray[np.float64], seed: int) -> dict[str, list[float]]:
    """Segments as a person would place them: x, y, z [m] and quaternion x, y, z, w in the board's frame."""
    random, placed = np.random.default_rng(seed), {}
    to_board = Rotation.from_matrix(world_T_board[:3, :3]).inv()
    for segment in truth.places:
        position, turned = truth.at(truth.seconds[:1] + begin_s, segment)
        where = to_board.apply(position[0] - world_T_board[:3, 3]) + random.normal(0.0, _PLACED_M, 3)
        how = to_board * turned[0] * Rotation.from_rotvec(random.normal(0.0, _PLACED_RAD, 3))
        placed[segment] = [*where.tolist(), *how.as_quat().tolist()]
    return placed


def _figures(group: str, counts: list[tuple[int, int]]) -> Iterator[Figure]:
    far, unnamed = np.sum(counts, axis=0).tolist()
    yield Figure(f"{group}: segments over 15 cm or 60 deg off, in all states", far)
    yield Figure(f"{group}: of these without a finding", unnamed)
    yield Figure(f"{group}: starts with one without a finding", sum(bool(missing) for _, missing in counts))


def moved_start(start: Path, moved: Path, seed: int) -> Path:
    """Write a start whose segments are a millimetre elsewhere, at random."""
    random, poses = np.random.default_rng(seed), yaml.safe_load(start.read_text())
    for pose in poses.values():
        pose[:3] = (np.array(pose[:3]) + random.normal(0.0, _START_M, 3)).tolist()
    moved.write_text(yaml.safe_dump(poses))
    return moved


def large_errors(scored: Score, output: str) -> tuple[int, int]:
    """Segments in states that are far off, and how many of them no printed finding names with that time.

    A turn counts by the direction of the bone: capsules do not show the turn about it, and its sigma has that.
    """
    seconds = scored.seconds - scored.seconds[0]
    wrong = {
        segment: (off_cm > _FAR_CM) | (_turned_deg(scored, segment) > _TURNED_DEG)
        for segment, off_cm in scored.position_cm.items()
    }
    return _count(wrong, seconds, output)


def _count(wrong: dict[str, Mask], seconds: NDArray[np.float64], output: str) -> tuple[int, int]:
    """How many states of segments are wrong (T,), and how many of them no finding names."""
    unnamed = [(each & ~_named(output, segment, seconds)).sum() for segment, each in wrong.items()]
    return int(np.sum([*wrong.values()])), int(np.sum(unnamed))


def _turned_deg(scored: Score, segment: str) -> NDArray[np.float64]:
    """(T,) angle between a segment's long axis and the true one [deg]."""
    axis = 0 if segment.startswith("foot") else 2
    ours = scored.link(segment)[:, :3, axis]
    theirs = scored.truth.at(scored.seconds, segment)[1].as_matrix()[:, :, axis]
    return np.asarray(np.degrees(np.arccos(np.clip(np.sum(ours * theirs, axis=1), -1.0, 1.0))))


def _named(output: str, segment: str, seconds: NDArray[np.float64]) -> Mask:
    """(T,) states that a finding on a segment lists."""
    named = np.zeros(len(seconds), bool)
    text = " ".join(output.split())
    alone = rf"segment {segment}: [^:]*: "
    merged = rf"segments \([^)]*\b{segment}\b[^)]*\): [^:]*: "
    counted = rf"likewise \d+ more segments: (?:[^;]*, )?{segment} \("
    found = re.search(rf"(?:{alone}|{merged}|{counted})(?P<what>(?:[\d.]+ to [\d.]+ s(?:, )?)+)", text)
    for start_s, end_s in re.findall(r"([\d.]+) to ([\d.]+) s", found["what"]) if found else ():
        named |= (seconds >= float(start_s) - _EDGE_S) & (seconds <= float(end_s) + _EDGE_S)
    return named
