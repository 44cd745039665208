"""A foot that leaves its pedal and comes back, as far as the cameras say so."""

from dataclasses import replace

import numpy as np
import pytest
from known_motion import BODY

from bodycam_ros.equipment.coupled_body import coupled_body
from bodycam_ros.equipment.equipment import Attachment, Equipment, Interval, SegmentMotion
from bodycam_ros.equipment.unknown_lengths import UnknownLengths
from bodycam_ros.geometry import Array, rigid
from bodycam_ros.solving.attachment_watch import AttachmentWatch
from bodycam_ros.solving.coupling_settings import CouplingSettings

SETTINGS = CouplingSettings(release_distance=0.05, engage_distance=0.03, confirm_frames=3)
PLAY_M = 0.002
ON_FOOT = np.array([[0.1, 0.0, -0.08], [0.1, 0.04, -0.08]])
FOOT = BODY.segment_index["foot_left"]
NOTHING = np.zeros(0)
RELEASE_M, ENGAGE_M = 0.05 + 2.0 * PLAY_M, 0.03 + 2.0 * PLAY_M
"""With twice the play that its points have."""


def watch(
    detected: bool = True, intervals: tuple[Interval, ...] | None = None, unknown: tuple[float, ...] = (0.0, 0.0, 0.0)
) -> AttachmentWatch:
    """Of a pedal that the left foot stands on, its origin where the foot's is."""
    pedal = Attachment(
        "foot", "foot_left", "pedal", ON_FOOT, ON_FOOT, np.full(2, PLAY_M),
        unknown=np.array(unknown), intervals=intervals, detected=detected,
    )  # fmt: skip
    hand = replace(pedal, name="hand", body_segment="forearm_left")
    scooter = Equipment("scooter", "pedal", {"pedal": SegmentMotion()}, (), (pedal, hand))
    return AttachmentWatch(coupled_body(BODY, scooter), scooter, UnknownLengths(scooter, ()), SETTINGS)


def poses(apart_m: float) -> Array:
    """(S, 4, 4) with the foot so far above the pedal, which is at the origin."""
    world_T_segment = np.tile(np.eye(4), (len(BODY.segments) + 1, 1, 1))
    world_T_segment[FOOT] = rigid(np.eye(3), np.array([0.0, 0.0, apart_m]))
    return world_T_segment


PEDAL = np.eye(4)[None]


def seen(watched: AttachmentWatch, apart_m: float, seconds: float = 0.0) -> bool:
    """Whether the foot holds the pedal after one more instant."""
    looked = watched.look(seconds, poses(apart_m), [FOOT])
    watched.notice(watched.distances(looked, PEDAL, NOTHING), NOTHING)
    return watched.holding.engaged["foot"]


def test_it_is_let_go_once_some_instants_in_a_row_say_so() -> None:
    watched = watch()
    assert [seen(watched, far) for far in (0.001, 0.2, 0.2, 0.001, 0.2, 0.2, 0.2, 0.2)] == [True] * 6 + [False] * 2


def test_it_is_taken_hold_of_again_likewise() -> None:
    watched = watch()
    assert not [seen(watched, 0.2) for _ in range(3)][-1]
    assert [seen(watched, far) for far in (0.01, 0.01, 0.2, 0.01, 0.01, 0.01)] == [False] * 5 + [True]


@pytest.mark.parametrize(("apart_m", "lets_go"), [(RELEASE_M - 1e-4, False), (RELEASE_M + 1e-4, True)])
def test_farther_than_it_may_be_is_too_far(apart_m: float, lets_go: bool) -> None:
    watched = watch()
    assert [seen(watched, apart_m) for _ in range(10)][-1] != lets_go


@pytest.mark.parametrize(("apart_m", "takes_hold"), [(ENGAGE_M - 1e-4, True), (ENGAGE_M + 1e-4, False)])
def test_between_the_two_distances_it_stays_as_it_is(apart_m: float, takes_hold: bool) -> None:
    off, on = watch(), watch()
    assert not [seen(off, 0.2) for _ in range(3)][-1]
    assert [seen(off, apart_m) for _ in range(10)][-1] == takes_hold
    assert all(seen(on, apart_m) for _ in range(10))


def test_what_always_holds_is_never_let_go() -> None:
    watched = watch(detected=False)
    assert all(seen(watched, 0.2) for _ in range(10))


def test_it_holds_within_its_intervals_alone() -> None:
    watched = watch(intervals=((0.5, 1.0), (2.0, np.inf)))
    held = {seconds: seen(watched, 0.0, seconds) for seconds in (0.0, 0.49, 0.5, 0.8, 1.0, 1.01, 1.99, 2.0, 99.0)}
    assert [seconds for seconds, holds in held.items() if holds] == [0.5, 0.8, 1.0, 2.0, 99.0]


def test_out_of_its_interval_a_foot_may_be_anywhere() -> None:
    watched = watch(intervals=((1.0, 2.0),))
    assert not any(seen(watched, 0.5, 0.1 * frame) for frame in range(10))
    assert seen(watched, 0.0, 1.0)


def test_what_nobody_sees_stays_as_it_is() -> None:
    watched = watch()
    for _ in range(5):
        looked = watched.look(0.0, poses(0.5), [])
        assert not looked.holds["foot"][0]
        assert watched.distances(looked, PEDAL, NOTHING) == {}
        watched.notice({}, NOTHING)
    assert watched.holding.engaged["foot"]
    assert not watched.holding.drives(frozenset({"foot"}))


def test_the_instants_that_speak_against_it_are_counted_only_while_it_is_seen() -> None:
    watched = watch()
    for _ in range(2):
        assert seen(watched, 0.2)
    watched.look(0.0, poses(0.2), [])
    watched.notice({}, NOTHING)
    assert not seen(watched, 0.2)


def test_it_drives_what_it_is_seen_to_hold() -> None:
    watched = watch()
    assert seen(watched, 0.0)
    holding = watched.holding
    assert holding.seen == {"foot"}
    assert holding.drives(frozenset({"foot", "hand"})) and not holding.drives(frozenset({"hand"}))
    for _ in range(3):
        seen(watched, 0.2)
    assert not watched.holding.drives(frozenset({"foot"}))


def test_of_what_is_seen_only_what_holds_counts_in_a_fit() -> None:
    watched = watch()
    looked = watched.look(0.0, poses(0.2), [FOOT])
    np.testing.assert_allclose(looked.points["foot"][0], ON_FOOT + [0.0, 0.0, 0.2])
    assert watched.held(looked).holds["foot"][0] and not watched.held(looked).holds["hand"][0]
    for _ in range(3):
        seen(watched, 0.2)
    looked = watched.look(0.0, poses(0.2), [FOOT])
    assert looked.holds["foot"][0] and not watched.held(looked).holds["foot"][0]


def test_when_it_is_placed_what_is_far_does_not_begin_to_hold() -> None:
    near, far = watch(), watch()
    for watched, apart_m in ((near, 0.01), (far, 0.2)):
        looked = watched.look(0.0, poses(apart_m), [FOOT])
        watched.begin(watched.distances(looked, PEDAL, NOTHING), NOTHING)
    assert near.holding.engaged["foot"] and not far.holding.engaged["foot"]
    assert far.holding.engaged["hand"], "nobody has seen it yet"


def test_what_always_holds_holds_from_the_beginning() -> None:
    watched = watch(detected=False)
    looked = watched.look(0.0, poses(0.2), [FOOT])
    watched.begin(watched.distances(looked, PEDAL, NOTHING), NOTHING)
    assert watched.holding.engaged["foot"]


def test_where_its_place_is_unknown_it_may_be_farther() -> None:
    """Three times as far as nobody knows; once that has been learned, no more."""
    watched = watch(unknown=(0.0, 0.0, 0.1))
    sigmas = np.array([0.1])
    looked = watched.look(0.0, poses(0.3), [FOOT])
    distances = watched.distances(looked, PEDAL, np.zeros(1))
    assert distances["foot"] == pytest.approx(0.3)
    assert watched.contradicted(distances, sigmas) == 0
    assert watched.contradicted(distances, 0.1 * sigmas) == 1
    assert watched.limit("foot", 0.05, sigmas) == pytest.approx(RELEASE_M + 0.3)
    learned = watched.distances(looked, PEDAL, np.array([0.29]))
    assert learned["foot"] == pytest.approx(0.01)
