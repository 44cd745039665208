"""Masses of a person against Pinocchio, which sums up what a URDF has, and against the tables they are from."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio
import pytest
from helpers.naming import naming

from bodycam_ros.body.average_person import body_of_height, person_masses
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.errors import BodyError

KG = 72.5


def without(body: BodyModel, *kinds: str) -> BodyModel:
    """The body without some kinds of segments."""
    gone = [segment for segment in body.segments if segment.startswith(kinds)]
    return replace(
        body,
        segments=tuple(segment for segment in body.segments if segment not in gone),
        joints=tuple(joint for joint in body.joints if joint.child not in gone),
    )


@pytest.mark.parametrize("which", ["sample", "with hands", "legs"])
def test_masses_add_up_and_inertias_are_those_of_bodies(sample: Path, which: str) -> None:
    body = read_body(sample / "body.yaml")
    if which == "with hands":
        body = body_of_height(1.8, "tall")
    elif which == "legs":
        body = without(body_of_height(1.6, "legs"), "torso", "head", "upper_arm", "forearm", "hand")
    masses = person_masses(body, KG)
    assert tuple(masses) == body.segments
    assert sum(mass.kilograms for mass in masses.values()) == pytest.approx(KG)
    for mass in masses.values():
        a, b, c = np.linalg.eigvalsh(mass.inertia)
        assert 0.0 < a and c < a + b, "no body resists a turn more than about the two other axes together"
    model = pinocchio.buildModelFromXML(urdf_text(body, masses), pinocchio.JointModelFreeFlyer())
    assert pinocchio.computeTotalMass(model) == pytest.approx(KG)


def test_the_centre_of_mass_is_at_56_percent_of_the_stature() -> None:
    """As textbooks have it: 55 % of women's, 57 % of men's."""
    body = body_of_height(1.74, "usual")
    model = pinocchio.buildModelFromXML(urdf_text(body, person_masses(body, KG)), pinocchio.JointModelFreeFlyer())
    above_hips = pinocchio.centerOfMass(model, model.createData(), pinocchio.neutral(model))
    hips = 0.53  # of the stature: thigh, shin and the height of the ankle
    assert hips + above_hips[2] / 1.74 == pytest.approx(0.56, abs=0.02)
    assert abs(above_hips[1]) < 1e-6


def test_what_a_body_lacks_is_part_of_the_next_segment() -> None:
    whole = body_of_height(1.74, "usual")
    complete, handless = person_masses(whole, KG), person_masses(without(whole, "hand"), KG)
    both = complete["forearm_left"].kilograms + complete["hand_left"].kilograms
    assert handless["forearm_left"].kilograms == pytest.approx(both)
    assert handless["forearm_left"].centre[2] < complete["forearm_left"].centre[2]
    assert handless["thigh_left"].kilograms == complete["thigh_left"].kilograms


def test_a_longer_bone_moves_the_centre_and_resists_more() -> None:
    usual = body_of_height(1.74, "usual")
    shin = next(joint for joint in usual.joints if joint.name == "ankle_left")
    place = shin.parent_T_joint.copy()
    place[:3, 3] *= 1.2
    longer = replace(
        usual, joints=tuple(replace(j, parent_T_joint=place) if j.name == shin.name else j for j in usual.joints)
    )
    before, after = person_masses(usual, KG)["shin_left"], person_masses(longer, KG)["shin_left"]
    np.testing.assert_allclose(after.centre, 1.2 * before.centre, rtol=1e-2)
    np.testing.assert_allclose(after.inertia, 1.44 * before.inertia, rtol=2e-2)


def test_a_body_without_a_pelvis_has_no_such_masses() -> None:
    with naming(BodyError, "pelvis"):
        person_masses(BodyModel("stick", "stick", ("stick",), (), {}), KG)
