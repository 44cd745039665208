from dataclasses import replace

import pytest

from bodycam_ros.calibration.anthropometry import (
    PROPORTIONS,
    AnthropometrySettings,
    BoneLength,
    expected_stature,
    judge_bones,
    odd_scale,
    refuse_impossible,
)
from bodycam_ros.errors import MapError

SIGMA_M = 0.002
ENDS = {"upper_arm": ("shoulder", "elbow"), "thigh": ("hip", "knee"), "shin": ("knee", "ankle")}


def limbs(stature_m: float) -> list[BoneLength]:
    """Arms and legs of a body midway between a man's and a woman's."""
    bones = []
    for side in ("_left", "_right"):
        for kind, (start, end) in ENDS.items():
            length_m = PROPORTIONS[kind, frozenset({start, end})].middle * stature_m
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


def test_the_table_is_that_of_de_leva() -> None:
    thigh = PROPORTIONS["thigh", frozenset({"hip", "knee"})]
    assert (thigh.low, thigh.high) == pytest.approx((0.3685 / 1.735, 0.4222 / 1.741))
    upper_arm = PROPORTIONS["upper_arm", frozenset({"shoulder", "elbow"})]
    assert (upper_arm.low, upper_arm.high) == pytest.approx((0.1586, 0.1618), abs=5e-5)


@pytest.mark.parametrize(("men_m", "lengths"), [(1.741, (0.2817, 0.4222, 0.4403)), (1.735, (0.2751, 0.3685, 0.4386))])
def test_the_men_and_the_women_of_the_table_pass(men_m: float, lengths: tuple[float, float, float]) -> None:
    bones = [replace(bone, length_m=lengths[index % 3]) for index, bone in enumerate(limbs(men_m))]
    assert expected_stature(bones) == pytest.approx(men_m, rel=0.03)
    assert not any(bone.warning for bone in judge_bones(bones))


def test_one_odd_bone_is_named_and_moves_neither_the_stature_nor_the_others() -> None:
    bones = limbs(1.75)
    thigh = bones[1]
    assert thigh.segment == "thigh_left"
    bones[1] = replace(thigh, length_m=0.31)
    assert expected_stature(bones) == pytest.approx(1.75, rel=1e-9)
    judged = {bone.segment: bone for bone in judge_bones(bones)}
    warning = judged["thigh_left"].warning
    assert "left thigh 31.0 cm: people 1.75 m tall have 37 to 42 cm" in warning
    assert "hip_left and knee_left" in warning
    assert judged["thigh_left"].length_m == 0.31, "warned about, never imposed"
    assert judged["thigh_left"].asymmetry_m == pytest.approx(0.31 - thigh.length_m)
    assert judged["thigh_right"].asymmetry_m == pytest.approx(thigh.length_m - 0.31)
    assert not any(bone.warning for name, bone in judged.items() if name != "thigh_left")


def test_an_uncertain_bone_is_not_called_odd() -> None:
    bones = limbs(1.75)
    bones[1] = replace(bones[1], length_m=0.31, sigma_m=0.04)
    assert not any(bone.warning for bone in judge_bones(bones))


def test_the_tolerance_is_the_setting() -> None:
    bones = limbs(1.75)
    shin = bones[2]
    bones[2] = replace(shin, length_m=shin.length_m + 0.013)
    assert not any(bone.warning for bone in judge_bones(bones))
    (warning,) = filter(None, (bone.warning for bone in judge_bones(bones, AnthropometrySettings(tolerance=0.02))))
    assert warning.startswith("left shin")


def test_sides_that_differ_are_said_once_and_only_beyond_millimetres_and_sigmas() -> None:
    bones = limbs(1.75)
    arm = bones[0]
    bones[0] = replace(arm, length_m=arm.length_m + 0.014)
    assert not any(bone.warning for bone in judge_bones(bones))
    bones[0] = replace(arm, length_m=arm.length_m + 0.016)
    (warning,) = filter(None, (bone.warning for bone in judge_bones(bones)))
    assert "left upper arm 29.6 cm, right upper arm 28.0 cm: they differ by 16 mm" in warning
    unsure = [replace(bone, sigma_m=0.004) for bone in bones]
    assert not any(bone.warning for bone in judge_bones(unsure))


def test_unknown_names_are_taken_as_they_are() -> None:
    machine = [BoneLength("crank", "axle", "pedal_left", 0.17, 1e-3), BoneLength("tail", "hip_left", "knee_left", 9, 1)]
    for judged in judge_bones([*machine, *limbs(1.75)])[:2]:
        assert (judged.expected_m, judged.mirror_m, judged.asymmetry_m, judged.warning) == (None, None, None, "")


def test_bones_inside_the_trunk_have_partners_but_no_expectation() -> None:
    trunk = [
        BoneLength("torso", "neck", "shoulder_left", 0.21, SIGMA_M),
        BoneLength("torso", "neck", "shoulder_right", 0.24, SIGMA_M),
        BoneLength("torso", "shoulder_left", "shoulder_right", 0.40, SIGMA_M),
        BoneLength("pelvis", "hip_left", "hip_right", 0.19, SIGMA_M),
    ]
    left, right, shoulders, hips = judge_bones([*trunk, *limbs(1.75)])[:4]
    assert left.asymmetry_m == pytest.approx(-0.03) and right.asymmetry_m == pytest.approx(0.03)
    assert "torso from neck to left shoulder 21.0 cm" in left.warning and right.warning == ""
    for middle in (shoulders, hips):
        assert (middle.expected_m, middle.mirror_m, middle.warning) == (None, None, "")


def test_too_few_bones_make_no_stature() -> None:
    bones = limbs(1.75)[1:3]
    assert expected_stature(bones) is None
    assert all(bone.expected_m is None and bone.warning == "" for bone in judge_bones(bones))
    assert expected_stature([]) is None and judge_bones([]) == []
    assert expected_stature(bones, AnthropometrySettings(least_bones=2)) == pytest.approx(1.75)


@pytest.mark.parametrize(
    ("factor", "said"),
    [(10.0, r"about 10 \(too large\)"), (0.1, r"about 9\.9 \(too small\)"), (25.4, r"about 26 \(too large\)")],
)
@pytest.mark.parametrize("count", [1, 6])
def test_bones_that_nobody_has_accuse_the_scale_of_the_map(factor: float, said: str, count: int) -> None:
    with pytest.raises(MapError, match=rf"nobody is: the map's scale looks wrong by a factor of {said}.*board.yaml"):
        refuse_impossible(limbs(1.75 * factor)[:count])


@pytest.mark.parametrize("stature_m", [0.75, 1.25, 1.75, 2.05, 2.72])
def test_nobody_who_lived_is_refused(stature_m: float) -> None:
    refuse_impossible(limbs(stature_m))


def test_bones_of_no_known_proportion_accuse_nothing() -> None:
    refuse_impossible([BoneLength("torso", "spine", "neck", 45.0, SIGMA_M)])


@pytest.mark.parametrize(
    ("stature_m", "said"), [(1.75 * 1.5, "about 1.5 (too large)"), (1.75 / 1.5, "about 1.5 (too small)")]
)
def test_an_odd_stature_is_a_warning(stature_m: float, said: str) -> None:
    assert said in odd_scale(expected_stature(limbs(stature_m)))


@pytest.mark.parametrize("stature_m", [None, 1.25, 1.75, 2.05])
def test_a_usual_stature_is_none(stature_m: float | None) -> None:
    assert odd_scale(stature_m) == ""


def test_what_is_odd_or_impossible_is_a_setting() -> None:
    giants = AnthropometrySettings(odd_above=30.0, impossible_above=30.0)
    refuse_impossible(limbs(17.5), giants)
    assert odd_scale(17.5, giants) == ""
