"""What a map must know before a body is made or solved in it."""

from dataclasses import replace
from pathlib import Path

import pytest
from two_cameras import write_map

from bodycam_ros.errors import MapError
from bodycam_ros.registration.map_frame import assumed_vertical, check_metric, check_upright
from bodycam_ros.registration.reference_map import ReferenceMap


@pytest.fixture
def whole(tmp_path: Path) -> ReferenceMap:
    return ReferenceMap.load(write_map(tmp_path / "map"))


PATH = Path("place")


def test_a_map_with_scale_and_vertical_serves(whole: ReferenceMap) -> None:
    check_metric(whole, PATH)
    check_upright(whole, PATH)
    assert assumed_vertical(whole, PATH) == ""


@pytest.mark.parametrize("check", [check_metric, check_upright])
def test_without_scale_there_is_no_body(whole: ReferenceMap, check) -> None:
    with pytest.raises(MapError, match="place: this map is not metric.*AprilTag board"):
        check(replace(whole, metric=False), PATH)


def test_without_a_vertical_a_body_can_be_solved_but_not_made(whole: ReferenceMap) -> None:
    tilted = replace(whole, gravity_aligned=False)
    check_metric(tilted, PATH)
    assert "z of the output is the board's z" in assumed_vertical(tilted, PATH)
    with pytest.raises(MapError, match="place: this map does not know what is up"):
        check_upright(tilted, PATH)
