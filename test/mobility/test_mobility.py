from dataclasses import replace

import numpy as np
import pytest
from athletes import barbell, bicycle, snowboard
from known_motion import BODY

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.joint import Joint
from bodycam_ros.equipment.equipment import Attachment, Equipment, SegmentMotion
from bodycam_ros.geometry import rigid
from bodycam_ros.mobility.closing import closed, placed
from bodycam_ros.mobility.mechanism import Mechanism
from bodycam_ros.mobility.mobility import Mobility, mobility
from bodycam_ros.mobility.projection import constraints, projected


def four_bar() -> BodyModel:
    """Four bars in a plane, hinged in a ring: the joints of all four say three times that it is a plane."""
    z = np.array([0.0, 0.0, 1.0])

    def at(x: float, y: float) -> np.ndarray:
        return rigid(np.eye(3), np.array([x, y, 0.0]))

    joints = (
        Joint("a", "ground", "left", "hinge", at(0.0, 0.0), axis=z),
        Joint("b", "left", "top", "hinge", at(0.0, 0.5), axis=z),
        Joint("c", "ground", "right", "hinge", at(1.0, 0.0), axis=z),
        Joint("d", "right", "top", "hinge", at(0.1, 0.6), at(1.1, 0.1), axis=z),
    )
    return BodyModel("ring", "ground", ("ground", "left", "top", "right"), joints, {})


def test_a_plane_ring_moves_though_gruebler_says_that_it_cannot() -> None:
    # B eq. 9 in space: 6 x 4 - 4 x 5 = 4, of which 6 would be of all together; in truth the ring has one besides.
    found = mobility(four_bar())
    assert found.count.freedoms == 4
    assert (found.freedoms, found.parts.as_a_whole, found.parts.others) == (7, 6, 1)
    assert found.parts.of_others == ("a", "b", "c")
    assert (found.rows, found.rank, found.rank_along) == (5, 2, (2, 2))
    # Of the ring's rows those remain that its plane does not say: two places.
    assert len(found.redundant) == 3
    assert all(name.startswith("d: ") for name in found.redundant)
    assert "d: place, up" in found.redundant
    assert not found.contradictions


@pytest.fixture(scope="module")
def ridden() -> Mobility:
    return mobility(BODY, bicycle())


@pytest.mark.parametrize(
    ("athlete", "freedoms", "as_a_whole"),
    # 6 x 16 segments; 12 balls, 3 hinges, two attachments of six rows and three of three; the others alike.
    [("cyclist", 6 * 16 - 12 * 3 - 3 * 5 - 2 * 6 - 3 * 3, 0), ("rider", 84 - 36 - 12, 6), ("lifter", 84 - 36 - 9, 6)],
)
def test_what_an_athlete_holds_takes_the_freedoms_that_gruebler_counts(
    athlete: str, freedoms: int, as_a_whole: int, ridden: Mobility
) -> None:
    holds = {"rider": snowboard, "lifter": barbell}
    found = mobility(BODY, holds[athlete]()) if athlete in holds else ridden
    assert found.count.freedoms == found.freedoms == freedoms
    assert found.parts.as_a_whole == as_a_whole
    assert found.rows == found.rank == found.rank_along[0] == found.rank_along[1]
    assert not found.redundant and not found.contradictions and not found.parts.stuck
    assert freedoms == told(found)


def told(found: Mobility) -> int:
    """All freedoms that are told of."""
    parts = found.parts
    led = sum(motion.freedoms for motion in parts.led)
    return parts.as_a_whole + led + parts.others + sum(parts.untouched.values())


def test_a_crank_takes_both_legs_along_and_no_neck_and_bends_nobody_too_far(ridden: Mobility) -> None:
    crank = next(motion for motion in ridden.parts.led if motion.joint == "crank_axle")
    assert crank.freedoms == 1
    assert {"hip_left", "knee_left", "knee_right"} <= crank.with_joints.keys()
    assert "neck" not in crank.with_joints
    assert ridden.parts.untouched == {"neck": 3}
    assert not ridden.beyond_limits


def test_null_motions_keep_the_loops_closed() -> None:
    mechanism = Mechanism(BODY, bicycle())
    columns = mechanism.columns("place", "joint")
    configuration = projected(mechanism, closed(mechanism, placed(mechanism)), columns)
    rows = constraints(mechanism, configuration, standing=mechanism.poses(configuration))
    np.testing.assert_allclose(rows.residuals, 0.0, atol=1e-9)
    free = np.linalg.svd(rows.jacobian[:, columns])[2][rows.jacobian.shape[0] :]
    step = np.zeros(mechanism.column_count)
    for size in (1e-3, 1e-4):
        for direction in free:
            step[columns] = size * direction
            gaps = mechanism.loop_rows(mechanism.moved(configuration, step)).residuals
            # Closed to first order: what opens is of the order of the square [sigma of some mm].
            assert np.abs(gaps).max() < 2e3 * size**2


def test_what_says_the_same_twice_is_named_with_what_it_repeats() -> None:
    board = snowboard()
    left, right = board.attachments
    twice = replace(board, attachments=(left, right, replace(left, name="strap")))
    found = mobility(BODY, twice)
    assert {name.split(":")[0] for name in found.redundant} == {"strap"}
    assert len(found.redundant) == 6
    assert all(said.startswith("binding_left: ") for same in found.redundant.values() for said in same)
    assert found.freedoms == found.count.freedoms + 6 == 36


def test_a_crank_that_is_held_cannot_move() -> None:
    bike = bicycle()
    on_frame = next(a for a in bike.attachments if a.name == "saddle")
    grip = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])
    held = [
        Attachment(f"chain_{segment}", "pelvis", segment, grip, grip + on_frame.on_equipment, np.full(3, 0.01))
        for segment in ("frame", "crank")
    ]
    found = mobility(BODY, replace(bike, attachments=tuple(held)))
    assert "crank_axle" in found.parts.stuck
    assert "spindle_left" not in found.parts.stuck


def test_a_bar_three_metres_away_is_named_and_nothing_else() -> None:
    bike = bicycle()
    far = [
        replace(a, on_equipment=a.on_equipment + [3.0, 0.0, 0.0]) if a.name == "on_bar_left" else a
        for a in bike.attachments
    ]
    found = mobility(BODY, replace(bike, attachments=tuple(far)))
    (contradiction,) = found.contradictions
    assert contradiction.name == "on_bar_left"
    # As far as a bent arm comes nearer to it.
    assert 2.0 < contradiction.apart_m < 3.3


def test_a_bar_that_is_too_wide_for_both_hands_names_what_would_give_way() -> None:
    found = mobility(BODY, barbell(apart_m=2.6))
    names = {contradiction.name for contradiction in found.contradictions}
    assert names and names <= {"grip_left", "grip_right", "on_back"}
    reach = 0.34 + 0.28 + 0.2  # forearm to the grip, upper arm, half the shoulders
    for contradiction in found.contradictions:
        assert contradiction.apart_m == pytest.approx(1.3 - reach, abs=0.1)
        assert contradiction.against


def test_unknown_lengths_close_what_else_would_not() -> None:
    board = snowboard()
    left, right = board.attachments
    # Boots that are said to stand more than 4 m apart; the command's own test has such a board without unknowns.
    apart = replace(right, on_equipment=right.on_equipment + [4.0, 0.0, 0.0])
    unknown = replace(apart, unknown=np.array([5.0, 0.0, 0.0]))
    found = mobility(BODY, replace(board, attachments=(left, unknown)))
    assert not found.contradictions
    longer, _ = found.longer["binding_right"]
    assert longer[0] < -2.0 and abs(longer[1]) < 1e-3


def test_what_is_held_to_the_ground_has_no_motion_and_no_rank_along_any() -> None:
    grip = np.array([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0], [0.0, 0.0, 0.1]])
    strapped = Attachment("strap", "pelvis", "chair", grip, grip, np.full(3, 0.01))
    chair = Equipment("chair", "chair", {"chair": SegmentMotion(stands=True)}, (), (strapped,))
    found = mobility(BodyModel("sitter", "pelvis", ("pelvis",), (), {}), chair)
    assert found.freedoms == 0 and found.rank == 12
    assert found.rank_along is None
