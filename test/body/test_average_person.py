"""The body of average people: as tall as asked for, the same on both sides, with hands where there are forearms."""

from dataclasses import replace

import numpy as np
import pytest
from helpers.naming import naming

from bodycam_ros.body.average_person import (
    BONE_RANGES,
    BONES,
    NECK_TO_VERTEX,
    SHORTEST_M,
    TALLEST_M,
    USUAL_STATURE_M,
    body_of_height,
    stature_of,
    with_hands,
)
from bodycam_ros.body.body_model import BodyModel, sole_points
from bodycam_ros.body.segment_name import mirrored
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import rigid
from bodycam_ros.kinematics.joint import Joint


def origins(body: BodyModel) -> dict[str, np.ndarray]:
    """Segment -> (3,) in the N-pose, the root's origin at zero [m]."""
    return dict(zip(body.segments, body.n_pose(np.eye(4))[:, :3, 3], strict=True))


@pytest.mark.parametrize("height_m", [SHORTEST_M, 1.5, 1.78, TALLEST_M])
def test_a_body_is_as_tall_as_it_should_be(height_m: float) -> None:
    body = body_of_height(height_m, "person")
    assert stature_of(body) == pytest.approx(height_m)
    at = origins(body)
    shin = float(np.linalg.norm(at["foot_left"] - at["shin_left"]))
    soles = at["foot_left"][2] + sole_points(shin)[0, 2]
    top = at["head"][2] + NECK_TO_VERTEX * height_m
    # Bones and soles are from different tables.
    assert top - soles == pytest.approx(height_m, rel=0.03)


def test_both_sides_are_mirror_images() -> None:
    at = origins(body_of_height(1.8, "person"))
    for segment, place in at.items():
        other = mirrored(segment)
        np.testing.assert_allclose(place * [1.0, -1.0, 1.0], at[other or segment], atol=1e-12)
    assert at["thigh_left"][1] > 0.0, "y is to the left"


@pytest.mark.parametrize("height_m", [0.59, 2.76, 178.0, float("nan")])
def test_nobody_is_so_tall(height_m: float) -> None:
    with naming(BodyError, f"{height_m:g} m", SHORTEST_M, TALLEST_M):
        body_of_height(height_m, "person")


def test_the_stature_is_the_median_of_what_bones_let_expect() -> None:
    body = body_of_height(1.8, "person")
    assert stature_of(replace(body, segments=("pelvis",), joints=())) == USUAL_STATURE_M
    legs = [joint.name for joint in body.joints if joint.child == "foot_left"]
    long = tuple(
        replace(joint, parent_T_joint=rigid(np.eye(3), 2.0 * joint.parent_T_joint[:3, 3]))
        if joint.name in legs
        else joint
        for joint in body.joints
    )
    assert stature_of(replace(body, joints=long)) == pytest.approx(1.8), "one bone of eight is an outlier"


@pytest.mark.parametrize("kind", BONES)
def test_an_average_bone_is_between_those_of_women_and_men(kind: str) -> None:
    shorter, longer = BONE_RANGES[kind]
    assert 0.1 < shorter < BONES[kind] < longer < 0.3
    assert longer / shorter < 1.2


def test_a_forearm_gets_one_hand() -> None:
    body = body_of_height(1.8, "person")
    assert {"hand_left", "hand_right"} <= set(body.segments)
    assert with_hands(body).segments == body.segments
    elbow = Joint("elbow_left", "upper_arm_left", "forearm_left", "ball", rigid(np.eye(3), np.array([0.0, 0.0, -0.4])))
    arm = BodyModel("arm", "upper_arm_left", ("upper_arm_left", "forearm_left"), (elbow,), {})
    place = next(joint for joint in with_hands(arm).joints if joint.child == "hand_left").parent_T_joint
    # The forearm is as long for its upper arm as those of people are.
    np.testing.assert_allclose(place[:3, 3], [0.0, 0.0, -0.4 * BONES["forearm"] / BONES["upper_arm"]])
    lone = BodyModel("lone", "forearm_left", ("forearm_left",), (), {})
    wrist = with_hands(lone).joints[0]
    assert (wrist.parent, wrist.child) == ("forearm_left", "hand_left")
    assert wrist.parent_T_joint[2, 3] == pytest.approx(-BONES["forearm"] * USUAL_STATURE_M)
