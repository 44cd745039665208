"""Which map a live graph is in, and who contradicts it."""

from dataclasses import replace

import numpy as np
from helpers.registered_pose import registered_pose

from bodycam_ros.graph.map_agreement import MapAgreement
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.map_identity import MapIdentity
from bodycam_ros.results.verdict import Level

HALL, CELLAR = "9f86d081884c7d65", "60303ae22b998861"


def registered(camera: str, in_map: str, tracks_in: str = "") -> LandmarkMatches:
    return replace(registered_pose(camera, 1, 0, np.eye(4)), map_identity=in_map, tracks_map_identity=tracks_in)


def test_a_camera_in_another_map_is_left_out_until_it_comes_back() -> None:
    maps = MapAgreement()
    assert maps.add(registered("head", HALL), 0.0) and maps.add(registered("chest", f"{HALL}+1"), 0.0)
    assert not list(maps.findings(0.0)), "one extends the other"
    assert not maps.add(registered("chest", CELLAR), 1.0)
    (finding,) = maps.findings(1.0)
    assert (
        (finding.subject, finding.level) == ("chest", Level.WRONG) and HALL in finding.what and CELLAR in finding.what
    )
    assert maps.add(registered("chest", HALL), 2.0) and not list(maps.findings(2.0))


def test_the_map_is_exchanged_when_most_cameras_are_in_another() -> None:
    maps = MapAgreement()
    for camera in ("head", "chest", "foot"):
        assert maps.add(registered(camera, HALL), 0.0)
    assert not maps.add(registered("head", CELLAR), 1.0), "one of three"
    assert maps.add(registered("chest", CELLAR), 1.0), "two of three"
    assert maps.identity == MapIdentity(CELLAR)
    assert [each.subject for each in maps.findings(1.0)] == ["foot"]
    assert not list(maps.findings(9.0)), "who is silent contradicts nobody"


def test_tracks_of_another_map_are_wrong_though_their_registration_is_unregistered() -> None:
    maps = MapAgreement()
    assert maps.add(registered("head", HALL, HALL), 0.0)
    assert maps.add(registered("head", CELLAR, HALL), 1.0) is False
    (finding,) = maps.findings(1.0)
    assert "tracker" in finding.what and maps.identity == MapIdentity(HALL), (
        "a registration that uses nothing has no say"
    )


def test_registrations_of_an_unknown_map_are_used() -> None:
    maps = MapAgreement()
    assert maps.add(registered("head", ""), 0.0) and maps.add(registered("chest", HALL), 0.0)
    assert maps.add(registered("head", ""), 0.0) and not list(maps.findings(0.0))


def test_the_map_that_the_solver_was_given_stays() -> None:
    maps = MapAgreement(MapIdentity(HALL))
    assert not maps.add(registered("head", CELLAR), 0.0) and not maps.add(registered("chest", CELLAR), 0.0)
    assert len(list(maps.findings(0.0))) == 2
