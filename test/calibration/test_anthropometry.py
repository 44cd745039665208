from dataclasses import replace

import pytest
from helpers.naming import naming

from bodycam_ros.body.average_person import BONES
from bodycam_ros.calibration.anthropometry import BoneLength, expected_stature, judge_bones, refuse_impossible
from bodycam_ros.errors import MapError

SIGMA_M = 0.002
ENDS = {"upper_arm": ("shoulder", "elbow"), "thigh": ("hip", "knee"), "shin": ("knee", "ankle")}


def limbs(stature_m: float) -> list[BoneLength]:
    """Arms and legs of a body midway between a man's and a woman's."""
    bones = []
    for side in ("_left", "_right"):
        for kind, (start, end) in ENDS.items():
            length_m = BONES[kind] * stature_m
            bones.append(BoneLength(f"{kind}{side}", f"{start}{side}", f"{end}{side}", length_m, SIGMA_M))
    return bones


@pytest.mark.parametrize("stature_m", [1.2, 1.75, 2.0])
def test_a_body_of_the_tables_proportions_is_given_its_stature_and_no_warning(stature_m: float) -> None:
    bones = limbs(stature_m)
    assert expected_stature(bones) == pytest.approx(stature_m, rel=1e-12)
    for bone, judged in zip(bones, judge_bones(bones), strict=True):
        assert (judged.segment, judged.start, judged.end, judged.length_m) == (
            bone.segment,
            bone.start,
            bone.end,
            bone.length_m,
        )
        assert judged.expected_m == pytest.approx(bone.length_m, rel=1e-12)
        assert judged.asymmetry_m == pytest.approx(0.0, abs=1e-12)
        assert judged.warning == ""


def test_one_odd_bone_is_named_and_moves_neither_the_stature_nor_the_others() -> None:
    bones = limbs(1.75)
    thigh = bones[1]
    assert thigh.segment == "thigh_left"
    bones[1] = replace(thigh, length_m=0.31)
    assert expected_stature(bones) == pytest.approx(1.75, rel=1e-9)
    judged = {bone.segment: bone for bone in judge_bones(bones)}
    assert "thigh" in judged["thigh_left"].warning
    assert judged["thigh_left"].length_m == 0.31, "warned about, never imposed"
    assert judged["thigh_left"].asymmetry_m == pytest.approx(0.31 - thigh.length_m)
    assert judged["thigh_right"].asymmetry_m == pytest.approx(thigh.length_m - 0.31)
    assert not any(bone.warning for name, bone in judged.items() if name != "thigh_left")


@pytest.mark.parametrize("factor", [10.0, 0.1])
@pytest.mark.parametrize("count", [1, 6])
def test_bones_that_nobody_has_accuse_the_scale_of_the_map(factor: float, count: int) -> None:
    with naming(MapError, "board.yaml"):
        refuse_impossible(limbs(1.75 * factor)[:count])
