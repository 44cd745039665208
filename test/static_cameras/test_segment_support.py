"""Which segments count as lost, by their support in images."""

import numpy as np
import pytest

from bodycam_ros.body.average_person import body_of_height
from bodycam_ros.static_cameras.segment_support import SegmentSupport

BODY = body_of_height(1.75, "anyone")
ALIKE = np.full(len(BODY.segments), 0.8)


def _lost(**support: float) -> set[str]:
    judged = SegmentSupport(BODY)
    judged.update(np.array([support.get(segment, 0.8) for segment in BODY.segments]), ALIKE)
    return {segment for segment, is_lost in zip(BODY.segments, judged.false, strict=True) if is_lost}


def test_hand_before_its_own_colours_is_where_its_forearm_ends() -> None:
    assert _lost(hand_right=0.25) == set()


def test_forearm_and_hand_with_little_support_each_are_lost() -> None:
    assert _lost(forearm_right=0.47, hand_right=0.48) == {"forearm_right", "hand_right"}


@pytest.mark.parametrize("hidden", ["hand_right", "forearm_right"])
def test_hidden_segment_leaves_the_judgement_to_the_other(hidden: str) -> None:
    other = {"hand_right": "forearm_right", "forearm_right": "hand_right"}[hidden]
    assert _lost(**{hidden: np.nan, other: 0.4}) == {"forearm_right", "hand_right"}
    assert _lost(**{hidden: np.nan, other: 0.6}) == set()


def test_segment_that_the_first_images_hide_is_unseen_until_images_confirm_it() -> None:
    judged, row = SegmentSupport(BODY), BODY.segment_index["forearm_right"]
    unseen = []
    for support in (np.nan, 0.5, *[0.9] * 10):
        judged.update(np.where(np.arange(len(BODY.segments)) == row, support, 0.8), ALIKE)
        unseen.append(set(np.flatnonzero(judged.unseen).tolist()))
    assert unseen[:4] == [{row}] * 4, "one image of ten confirms nothing"
    assert unseen[-1] == set()


def _with(value: float, segment: str) -> np.ndarray:
    return np.where(np.arange(len(BODY.segments)) == BODY.segment_index[segment], value, 0.8)


def test_unseen_foot_that_is_unlike_the_other_is_not_confirmed_by_colours_of_its_own() -> None:
    """It learned those of what it was placed on, and they support it there."""
    judged, row = SegmentSupport(BODY), BODY.segment_index["foot_right"]
    judged.update(_with(np.nan, "foot_right"), _with(np.nan, "foot_right"))
    for _ in range(30):
        judged.update(_with(0.7, "foot_right"), _with(0.4, "foot_right"))
        assert judged.unseen[row]
    for _ in range(10):
        judged.update(_with(0.7, "foot_right"), _with(0.7, "foot_right"))
    assert not judged.unseen.any() and not judged.unlike.any()
    for _ in range(10):
        judged.update(_with(0.7, "foot_right"), _with(0.2, "foot_right"))
    assert np.flatnonzero(judged.unlike).tolist() == [row], "it was lost since"


def test_unseen_shin_is_confirmed_with_the_foot_that_it_points_to() -> None:
    judged, shin, foot = SegmentSupport(BODY), BODY.segment_index["shin_right"], BODY.segment_index["foot_right"]
    hidden, unsure = ALIKE.copy(), ALIKE.copy()
    hidden[[shin, foot]], unsure[foot] = np.nan, 0.4
    judged.update(hidden, ALIKE)
    judged.update(unsure, unsure)
    assert set(np.flatnonzero(judged.unseen)) == {shin, foot}
    for _ in range(20):
        judged.update(ALIKE, ALIKE)
    assert not judged.unseen.any()


def test_unseen_shin_is_confirmed_alone_while_its_foot_is_hidden() -> None:
    judged, shin, foot = SegmentSupport(BODY), BODY.segment_index["shin_right"], BODY.segment_index["foot_right"]
    hidden, shown = ALIKE.copy(), ALIKE.copy()
    hidden[[shin, foot]], shown[foot] = np.nan, np.nan
    judged.update(hidden, ALIKE)
    judged.update(shown, ALIKE)
    assert np.flatnonzero(judged.unseen).tolist() == [foot]


def test_unseen_foot_is_confirmed_by_fewer_colours_where_one_side_is_in_the_shade() -> None:
    judged, row, shade = SegmentSupport(BODY), BODY.segment_index["foot_right"], np.full(len(BODY.segments), 0.4)
    judged.update(_with(np.nan, "foot_right"), shade)
    for _ in range(10):
        judged.update(_with(0.7, "foot_right"), shade)
    assert not judged.unseen[row] and not judged.unlike[row]


def test_unseen_foot_is_not_confirmed_by_fewer_colours_because_others_are_lost() -> None:
    judged, row = SegmentSupport(BODY), BODY.segment_index["foot_right"]
    judged.update(_with(np.nan, "foot_right"), _with(np.nan, "foot_right"))
    for _ in range(30):
        judged.update(_with(0.7, "foot_right"), np.full(len(BODY.segments), 0.4))
    assert judged.unseen[row]


def test_feet_in_different_light_that_the_first_images_show_are_not_unlike() -> None:
    judged = SegmentSupport(BODY)
    for _ in range(30):
        judged.update(_with(0.6, "foot_right"), _with(0.15, "foot_right"))
    assert not judged.unlike.any() and not judged.unseen.any()


def test_segment_that_is_hidden_later_is_not_unseen() -> None:
    judged = SegmentSupport(BODY)
    judged.update(ALIKE, ALIKE)
    judged.update(np.full(len(BODY.segments), np.nan), ALIKE)
    assert not judged.unseen.any()


@pytest.mark.parametrize(("support", "named"), [(0.7, True), (0.8, False)])
def test_limb_of_weak_support_goes_with_the_next_one_that_is_elsewhere(support: float, named: bool) -> None:
    judged, upper_arm = SegmentSupport(BODY), BODY.segment_index["upper_arm_right"]
    seen = _with(support, "upper_arm_right")
    seen[BODY.named(["forearm_right", "hand_right"])] = 0.3
    judged.update(seen, ALIKE)
    assert judged.false.sum() == 2 and judged.unsupported[upper_arm] == named
    assert not judged.unsupported[BODY.segment_index["torso"]]


def test_limb_of_weak_support_alone_is_not_elsewhere() -> None:
    judged = SegmentSupport(BODY)
    judged.update(_with(0.65, "upper_arm_right"), ALIKE)
    assert not judged.unsupported.any()


def test_upper_arm_that_is_lost_takes_its_arm_along() -> None:
    assert _lost(upper_arm_left=0.3) == {"upper_arm_left", "forearm_left", "hand_left"}
