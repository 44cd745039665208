"""Unknown lengths and girths, on a body that is known."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_yaml import body_from_yaml, yaml_text
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array
from bodycam_ros.outside import girths
from bodycam_ros.outside.body_of_height import body_of_height
from bodycam_ros.outside.body_shape import BodyShape
from bodycam_ros.outside.capsules import capsule_surfaces
from bodycam_ros.outside.shape_settings import ShapeSettings

SETTINGS = ShapeSettings()


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return replace(read_body(sample / "body.yaml"), girths={"thigh_left": 1.2})


def radius(body: BodyModel, segment: str) -> float:
    """Of a limb [m], at its thickest."""
    return float(np.abs(capsule_surfaces(body)[segment].vertices[:, 0]).max())


def shares_of(shape: BodyShape, **by_name: float) -> Array:
    names = [f"{joint.name}_{'xyz'[axis]}" for joint, axis in shape.lengths] + shape.thick
    shares = np.zeros(shape.size)
    for name, share in by_name.items():
        shares[names.index(name)] = share
    return shares


def test_unknown_are_the_lengths_of_bones_and_the_girths_of_all_segments(body: BodyModel) -> None:
    shape = BodyShape(body, SETTINGS)
    names = [f"{joint.name}_{'xyz'[axis]}" for joint, axis in shape.lengths]
    assert {"knee_left_z", "shoulder_right_y", "shoulder_right_z", "spine_z"} < set(names)
    assert "knee_left_x" not in names and "ankle_left_y" not in names  # millimetres from the bone
    assert shape.thick == list(body.segments) and shape.size == len(names) + len(body.segments)


def test_a_share_moves_its_length_alone(body: BodyModel) -> None:
    shape = BodyShape(body, SETTINGS)
    shaped = shape.shaped(shares_of(shape, knee_left_z=0.05))
    for before, after in zip(body.joints, shaped.joints, strict=True):
        factor = np.array([1.0, 1.0, 1.05 if before.name == "knee_left" else 1.0])
        np.testing.assert_allclose(after.parent_T_joint[:3, 3], factor * before.parent_T_joint[:3, 3], atol=1e-12)


def test_girths_are_what_is_said_whatever_the_size_of_the_body(body: BodyModel) -> None:
    shape = BodyShape(body, SETTINGS)
    same = shape.shaped(np.zeros(shape.size))
    assert radius(same, "thigh_left") == pytest.approx(radius(body, "thigh_left"), rel=1e-9)
    longer = shares_of(shape, thigh_left=0.1, **{f"{bone}_{side}_z": 0.1 for bone in ("knee", "ankle", "elbow")
                                                 for side in ("left", "right")})  # fmt: skip
    grown = shape.shaped(longer)
    assert girths.stature_of(grown) == pytest.approx(1.1 * girths.stature_of(body), rel=1e-4)
    assert radius(grown, "thigh_left") == pytest.approx(1.1 * radius(body, "thigh_left"), rel=1e-3)
    assert radius(grown, "thigh_right") == pytest.approx(radius(body, "thigh_right"), rel=1e-3)


def test_what_is_expected_is_that_left_is_as_right(body: BodyModel) -> None:
    """Of legs that were begun with 10 % apart, both give way by half."""
    lengths = {"knee_left_z": 0.05, "knee_right_z": -0.05}
    first = BodyShape(body, SETTINGS)
    begun = first.shaped(shares_of(first, **lengths))
    shape = BodyShape(begun, SETTINGS)
    information, vector = shape.prior(np.zeros(shape.size))
    expected = shape.shaped(np.linalg.solve(information, vector))
    left, right = (
        abs(next(joint for joint in expected.joints if joint.name == name).parent_T_joint[2, 3])
        for name in ("knee_left", "knee_right")
    )
    assert abs(left - right) < 0.05 * abs(lengths["knee_left_z"] - lengths["knee_right_z"])
    assert 0.5 * (left + right) == pytest.approx(0.4262, abs=0.004)
    settled, step = shape.prior(np.linalg.solve(information, vector))
    np.testing.assert_allclose(step, 0.0, atol=1e-6 * np.abs(settled).max())


def test_a_body_of_a_height_has_the_stature_that_its_bones_let_expect() -> None:
    body = body_of_height(1.62, "jo")
    assert girths.stature_of(body) == pytest.approx(1.62, abs=1e-9)
    assert len(capsule_surfaces(body)) == len(body.segments) == 15  # with hands
    offsets = {joint.name: joint.parent_T_joint[:3, 3] for joint in body.joints}
    np.testing.assert_allclose(offsets["hip_left"], -offsets["hip_right"], atol=1e-12)
    assert offsets["shoulder_left"][1] > offsets["hip_left"][1] > 0.0


@pytest.mark.parametrize("height_m", [178.0, 0.3, float("nan")])
def test_nobody_is_so_tall(height_m: float) -> None:
    with pytest.raises(BodyError, match="nobody's height; expected 0.6 to 2.75 m"):
        body_of_height(height_m, "jo")


def test_girths_are_kept_in_the_file(body: BodyModel) -> None:
    again = body_from_yaml(yaml_text(body))
    assert again.girths == {"thigh_left": 1.2}
    assert radius(again, "thigh_left") == pytest.approx(1.2 * radius(replace(body, girths={}), "thigh_left"), rel=0.01)


@pytest.mark.parametrize(
    ("girth", "complaint"),
    [
        ("{tail: 1.0}", "girths: tail is not among the segments"),
        ("{pelvis: 40}", "girths: pelvis is 40 times as thick"),
        ("{pelvis: thick}", "girths: 'pelvis'"),
        ("[1.0]", "girths must be a table"),
    ],
)
def test_girths_that_nobody_has_are_refused(girth: str, complaint: str) -> None:
    with pytest.raises(BodyError, match=complaint):
        body_from_yaml(f"name: jo\nroot: pelvis\nsegments: [pelvis]\njoints: {{}}\ncameras: {{}}\ngirths: {girth}\n")
