"""Which map it is: neither folder nor pictures count, and an extended map is of the same world."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from helpers.known_keyframes import small_map

from bodycam_ros.mapping.extendable_map import ADDED, make_extendable
from bodycam_ros.registration.map_identity import MapIdentity, map_identity
from bodycam_ros.registration.reference_map import ReferenceMap


def test_a_map_is_the_same_wherever_it_lies(tmp_path: Path) -> None:
    made = small_map()
    made.save(tmp_path / "hall")
    identity = map_identity(ReferenceMap.load(tmp_path / "hall"))
    assert identity == map_identity(made) == map_identity(replace(made, photographs=None, summary={"note": "seen"}))
    assert MapIdentity.parse(str(identity)) == identity and len(str(identity)) == 16


def test_landmarks_that_are_others_make_another_map() -> None:
    made = small_map()
    moved = made.points_world.copy()
    moved[3, 1] += 1e-6
    others = [replace(made, points_world=moved), replace(made, landmark_ids=made.landmark_ids + np.uint32(1))]
    identities = [map_identity(each) for each in (made, *others)]
    assert len(set(identities)) == 3
    assert not identities[0].shares_world(identities[1]) and not identities[0].shares_world(identities[2])


def test_an_extended_map_is_another_version_of_the_same_world() -> None:
    made = small_map()
    extendable = make_extendable(made, 10)
    assert map_identity(extendable) == map_identity(made), "nothing is in its slots"
    added = np.zeros(1, ADDED)
    added["slot"], added["landmark_id"], added["point_world"] = 2, extendable.first_id + 2, (1.0, 2.0, 3.0)
    added["views"], added["sizes"] = (0.0, 0.0, 1.0), 0.01
    extendable.update(added)
    once = map_identity(extendable)
    added["point_world"] = (1.0, 2.0, 4.0)
    extendable.update(added)
    twice, compact = map_identity(extendable), map_identity(extendable.compact())
    assert len({map_identity(made), once, twice}) == 3
    assert all(each.shares_world(map_identity(made)) and each.extension for each in (once, twice, compact))
    assert MapIdentity.parse(str(twice)) == twice
