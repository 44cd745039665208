"""A result of which the start is missing is not called good."""

import pytest

from bodycam_ros.quality.unsolved_findings import unsolved_findings
from bodycam_ros.results.verdict import Level


@pytest.mark.parametrize(("solved", "contradictory", "level"), [(5, 16, Level.WRONG), (50, 10, Level.DOUBTFUL)])
def test_frames_that_are_missing_at_the_start_are_named(solved: int, contradictory: int, level: Level) -> None:
    (finding,) = unsolved_findings(solved, contradictory, {"head": 3, "forearm_left": 21, "forearm_right": 18})
    assert finding.level is level
    for named in (str(contradictory), str(solved + contradictory), "forearm_left, forearm_right, head"):
        assert named in finding.what


@pytest.mark.parametrize(("solved", "contradictory"), [(0, 0), (60, 0), (60, 3)])
def test_a_frame_or_two_are_no_finding(solved: int, contradictory: int) -> None:
    assert not [*unsolved_findings(solved, contradictory, {})]
