"""The same figures as the scorer that judges from outside, on the same bag."""

import importlib.util
import json
from pathlib import Path
from types import ModuleType

import numpy as np
import pytest
from helpers.known_walk import FRAMES, Walk, write_solved, write_truth

from benchmarks.body_from_truth import body_from_truth
from bodycam_ros.evaluate.comparison import read_true_motion
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.figures import figures_text
from bodycam_ros.geometry import exp_so3, rigid

pytestmark = pytest.mark.long

TOLERANCE = 1e-6  # [cm], [deg]

BETWEEN_FRAMES = 1e-4
"""[cm], [deg] where the truth is interpolated: the scorer keeps time in floats, to a quarter of a microsecond."""


@pytest.fixture(scope="module")
def scorer(shared: Path) -> ModuleType:
    path = shared.parent / "score.py"
    if not path.is_file():
        pytest.skip("the scorer (../shared/score.py) is not on this machine")
    specification = importlib.util.spec_from_file_location("score", path)
    assert specification is not None and specification.loader is not None
    module = importlib.util.module_from_spec(specification)
    specification.loader.exec_module(module)
    return module


def differences(ours: object, theirs: object, tolerance: float, where: str = "") -> dict[str, tuple[object, object]]:
    """Place -> both values, where nested figures differ."""
    if isinstance(ours, dict) and isinstance(theirs, dict):
        found: dict[str, tuple[object, object]] = {}
        for name in ours.keys() | theirs.keys():
            found |= differences(ours.get(name), theirs.get(name), tolerance, f"{where}/{name}")
        return found
    if isinstance(ours, float) and isinstance(theirs, float):
        return {} if abs(ours - theirs) <= tolerance else {where: (ours, theirs)}
    return {} if ours == theirs else {where: (ours, theirs)}


def truth_figures(out: Path, truth: Path) -> dict[str, object]:
    """Our figures against a truth, as the scorer has them: it knows neither least values nor deviations."""
    ours = json.loads(figures_text(evaluate(out, truth).figures))["truth"]
    for name in ("position_cm", "sim_position_cm", "angle_deg", "rotation_deg"):
        del ours[name]["min"], ours[name]["sd"]
    ours["per_joint"] = {
        segment: {name: each["mean"] for name, each in errors.items()} for segment, errors in ours["per_joint"].items()
    }
    assert isinstance(ours, dict)
    return ours


def with_errors(walk: Walk) -> Walk:
    """Another map, a root that shakes, a knee that is wrong more and more, and instants that are missing."""
    random = np.random.default_rng(6)
    noise = rigid(exp_so3(0.02 * random.normal(size=(len(walk.stamps_ns), 3))), np.zeros(3))
    noise[:, :3, 3] = 0.01 * random.normal(size=(len(walk.stamps_ns), 3))
    knee = "knee_left"
    shaken = Walk(walk.body, walk.stamps_ns, noise[:, None] @ walk.world_T_segment)
    bent = shaken.bent(knee, np.linspace(0.0, 10.0, len(walk.stamps_ns)))
    return bent.moved(rigid(exp_so3(np.array([0.02, 0.01, 1.0])), np.array([1.0, 2.0, 3.0]))).without([0, 7, 8, 30])


def test_on_the_walk_that_we_know(walk: Walk, truth: Path, scorer: ModuleType, tmp_path: Path) -> None:
    out = write_solved(with_errors(walk), tmp_path / "out")
    ours, theirs = truth_figures(out, truth), scorer.score(out, truth)
    assert theirs["position_cm"]["mean"] > 0.1 and theirs["frames"] == FRAMES - 4
    assert differences(ours, theirs, TOLERANCE) == {}


def test_on_a_ride_whose_truth_knows_no_bicycle(ride: Walk, scorer: ModuleType, tmp_path: Path) -> None:
    truth = write_truth(ride, tmp_path / "ride")
    out = write_solved(with_errors(ride), tmp_path / "out")
    ours, theirs = truth_figures(out, truth), scorer.score(out, truth)
    assert theirs["position_cm"]["mean"] > 0.1 and theirs["links_missing"] == []
    assert differences(ours, theirs, TOLERANCE) == {}


@pytest.mark.parametrize(
    ("name", "later_ns", "tolerance"), [("dev_walk", 0, TOLERANCE), ("dev_rom", 5_000_000, BETWEEN_FRAMES)]
)
def test_on_a_recording(
    shared: Path, scorer: ModuleType, tmp_path: Path, name: str, later_ns: int, tolerance: float
) -> None:
    """A full body whose truth has more segments than the rig, at the truth's own stamps and between them."""
    body, true = body_from_truth(shared / name), read_true_motion(shared / name)
    stamps_ns = true.stamps_ns[::3][:-1] + later_ns
    poses = np.stack([true.at(stamps_ns, segment) for segment in body.segments], axis=1)
    out = write_solved(with_errors(Walk(body, stamps_ns, poses)), tmp_path / "out")
    ours, theirs = truth_figures(out, shared / name), scorer.score(out, shared / name)
    assert theirs["links_missing"] == ["hand_left", "hand_right"]
    assert differences(ours, theirs, tolerance) == {}
