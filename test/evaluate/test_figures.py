"""Figures as they are written: names of fields, unknown ones as null, those of what is not there left out."""

import json
from pathlib import Path

import numpy as np
from msgspec.structs import fields, replace

from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.figures import (
    AgreementFigures,
    GaitFigures,
    JointFigures,
    PlaneFigures,
    Spread,
    figures_text,
    spread,
)
from bodycam_ros.evaluate.gait import MEASURES


def test_unknown_figures_are_null_and_those_of_what_is_not_there_are_left_out(solved: Path) -> None:
    figures = evaluate(solved).figures
    unknown = replace(figures.cameras["waist"], landmarks=np.nan)
    written = json.loads(figures_text(replace(figures, cameras={"waist": unknown})))
    assert written["cameras"]["waist"]["landmarks"] is None
    assert "truth" not in written and "clock" not in written["cameras"]["waist"]
    assert written["cameras"]["waist"]["position_gap_mm"].keys() == {"mean", "median", "p95", "max", "min", "sd"}


def test_names_that_python_reserves_are_written_as_they_were(solved: Path) -> None:
    one = Spread(1.0, 2.0, 3.0, 4.0, 0.5, 0.1)
    joint = JointFigures("rotations of bones", one, {"sagittal": PlaneFigures(one, 0.0, -1.0, 1.0, 0.5)})
    names = {field.name: field.encode_name for field in fields(AgreementFigures)}
    filled = dict.fromkeys(names, 0.0) | {"other": "walk.trc", "unit_m": None, "joints": {"knee left": joint}}
    written = json.loads(figures_text(replace(evaluate(solved).figures, agreement=AgreementFigures(**filled))))
    assert written["agreement"]["with"] == "walk.trc" and written["agreement"]["unit_m"] is None
    assert written["agreement"]["joints"]["knee left"]["from"] == "rotations of bones"


def test_every_measure_of_gait_has_its_figures() -> None:
    assert [field.name for field in fields(GaitFigures)] == ["strides", *MEASURES]


def test_a_spread_leaves_out_what_is_unknown() -> None:
    found = spread(np.array([[1.0, np.nan], [3.0, 2.0]]), 10.0)
    assert found == Spread(20.0, 20.0, 29.0, 30.0, 10.0, np.sqrt(200.0 / 3.0))
    assert np.isnan(spread(np.full(3, np.nan)).median)
