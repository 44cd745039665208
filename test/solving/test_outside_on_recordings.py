"""Recordings of static cameras alone, solved through ``replay`` and scored against the truth."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml
from made_once import made_once

from benchmarks.body_from_truth import body_from_truth
from bodycam_ros.body.body_file import write_body
from bodycam_ros.evaluate.true_motion import TrueMotion, read_true_motion
from bodycam_ros.geometry import Array, umeyama
from bodycam_ros.outside.outside_files import OutsideInput
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.replay.replay import replay
from bodycam_ros.solved.solved_recording import SolvedRecording, read_solved

EQUIPMENT = {"dev_outside_cycle": "bicycle"}


@dataclass(frozen=True, eq=False)
class Scored:
    """What was solved beside the truth, whose frame is that of the stations but for one rigid motion.

    Attributes:
        solved, true: both motions.
        truth_T_world: (4, 4).
        errors: segment -> (T,) distances of its origin from where it truly is [m].
    """

    solved: SolvedRecording
    true: TrueMotion
    truth_T_world: Array
    errors: dict[str, Array]


@pytest.fixture(scope="session")
def scored(shared: Path, tmp_path_factory: pytest.TempPathFactory):
    """Each recording is replayed once, for all tests of all workers."""

    @cache
    def of(name: str) -> Scored:
        recording = shared / name
        if not recording.is_dir():
            pytest.skip(f"the recording {name} is not on this machine")

        def make(folder: Path) -> None:
            write_body(body_from_truth(recording), folder / "body.yaml")
            outside = OutsideInput(
                recording / "external" / "cameras.yaml", recording / "body", recording / "external" / "start.yaml"
            )
            inputs = recording / "bag", None, folder / "body.yaml", folder / "out"
            replay(*inputs, PipelineSettings(), 1, equipment=EQUIPMENT.get(name), outside=outside)

        return scored_against(read_solved(made_once(tmp_path_factory, name, make) / "out"), recording)

    return of


def scored_against(solved: SolvedRecording, recording: Path) -> Scored:
    true = read_true_motion(recording)
    there = true.covers(solved.stamps_ns)
    names = [name for name in true.world_T_segment if name in solved.world_T_link]
    ours = np.stack([solved.world_T_link[name][there, :3, 3] for name in names])
    theirs = np.stack([true.at(solved.stamps_ns[there], name)[:, :3, 3] for name in names])
    _, R, t = umeyama(ours.reshape(-1, 3), theirs.reshape(-1, 3), with_scale=False)
    truth_T_world = np.eye(4)
    truth_T_world[:3, :3], truth_T_world[:3, 3] = R, t
    off = np.linalg.norm(ours @ R.T + t - theirs, axis=2)
    return Scored(solved, true, truth_T_world, dict(zip(names, off, strict=True)))


@pytest.mark.parametrize(("name", "mean_m"), [("dev_outside_cycle", 0.015), ("dev_outside_board", 0.02)])
def test_joints_are_where_they_truly_are(scored, name: str, mean_m: float) -> None:
    found = scored(name)
    errors = np.stack(list(found.errors.values()))
    print(f"{name}: mean {1e3 * errors.mean():.1f} mm, max {1e3 * errors.max():.1f} mm")
    assert len(found.errors) >= 13 and errors.shape[1] >= 119
    assert errors.mean() < mean_m
    assert (errors.mean(axis=1) < 2.0 * mean_m).all()


def test_feet_are_on_the_pedals(scored, shared: Path) -> None:
    """As near as B's figure 8 has them."""
    found, folder = scored("dev_outside_cycle"), shared / "dev_outside_cycle"
    ball = np.append(yaml.safe_load((folder / "equipment.yaml").read_text())["pedal_point_in_foot"], 1.0)
    known = np.loadtxt(folder / "truth" / "pedals.csv", delimiter=",", skiprows=1)
    seconds = 1e-9 * found.solved.stamps_ns
    means = []
    for side, first in (("left", 2), ("right", 5)):
        path = (found.truth_T_world @ found.solved.world_T_link[f"foot_{side}"] @ ball)[:, :3]
        pedal = np.stack([np.interp(seconds, known[:, 0], known[:, first + axis]) for axis in range(3)], axis=1)
        off = np.linalg.norm(path - pedal, axis=1)
        print(f"{side}: mean {1e3 * off.mean():.1f} mm, max {1e3 * off.max():.1f} mm")
        means.append(off.mean())
    assert np.mean(means) < 0.005 and max(means) < 0.006
