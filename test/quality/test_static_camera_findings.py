"""What static cameras did not support, and who is misplaced."""

from collections.abc import Collection

from helpers.naming import numbers

from bodycam_ros.quality.static_camera_findings import StaticCameraLog
from bodycam_ros.results.verdict import Level

ALL = ("pelvis", "forearm_left")


def log(
    unsupported: dict[str, Collection[int]], misplaced: int = 0, not_yet_shown: Collection[int] = ()
) -> StaticCameraLog:
    """Ten seconds at 10 Hz; states in which no image has shown the unsupported segments yet."""
    recorded = StaticCameraLog()
    for number in range(100):
        gone = [segment for segment, rows in unsupported.items() if number in rows]
        observed = [segment for segment in ALL if segment not in gone]
        recorded.add(
            number * 10**8,
            observed,
            gone,
            ["cam03"] if number < misplaced else [],
            not_yet_shown=gone if number in not_yet_shown else [],
        )
    return recorded


def test_what_is_supported_is_no_finding() -> None:
    assert not list(log({}).findings(ALL))
    assert not list(StaticCameraLog().findings(ALL))


def test_a_lost_segment_is_named_from_when_its_support_began_to_fall() -> None:
    (finding,) = log({"forearm_left": range(20, 50)}).findings(ALL)
    assert (finding.subject, finding.part, finding.level) == ("forearm_left", "segment", Level.WRONG)
    assert numbers(finding.what) == [1.0, 4.9]
    (finding,) = log({"forearm_left": range(3, 50)}).findings(ALL)
    assert numbers(finding.what) == [0.0, 4.9]


def test_a_short_loss_makes_a_result_doubtful_and_a_blink_nothing() -> None:
    assert [f.level for f in log({"forearm_left": range(20, 25)}).findings(ALL)] == [Level.DOUBTFUL]
    assert not list(log({"forearm_left": range(20, 22)}).findings(ALL))
    assert not list(log({"hand_left": range(20, 90)}).findings(ALL)), "a hand that the body does not have was added"


def test_a_segment_that_no_image_has_shown_yet_makes_a_result_doubtful_and_for_half_of_it_wrong() -> None:
    for states, level in ((40, Level.DOUBTFUL), (60, Level.WRONG)):
        (finding,) = log({"forearm_left": range(states)}, not_yet_shown=range(100)).findings(ALL)
        assert (finding.level, numbers(finding.what)) == (level, [0.0, (states - 1) / 10])
    (finding,) = log({"forearm_left": range(40)}, not_yet_shown=range(20)).findings(ALL)
    assert finding.level == Level.WRONG, "images contradict it for two seconds"
    now_and_then = [number for number in range(40) if number % 5]
    (finding,) = log({"forearm_left": range(40)}, not_yet_shown=now_and_then).findings(ALL)
    assert finding.level == Level.DOUBTFUL, "images that contradict it are too few in a row"


def test_a_segment_that_is_back_for_less_than_support_is_smoothed_over_is_named_throughout() -> None:
    (finding,) = log({"forearm_left": [*range(20, 40), *range(58, 70)]}).findings(ALL)
    assert numbers(finding.what) == [1.0, 6.9]
    (finding,) = log({"forearm_left": [*range(20, 40), 48]}).findings(ALL)
    assert numbers(finding.what) == [1.0, 4.8]
    (finding,) = log({"forearm_left": [*range(20, 40), *range(61, 70)]}).findings(ALL)
    assert numbers(finding.what) == [1.0, 3.9, 5.1, 6.9]


def test_a_misplaced_camera_makes_a_result_wrong() -> None:
    (finding,) = log({}, misplaced=90).findings(ALL)
    assert (finding.subject, finding.part, finding.level) == ("cam03", "camera", Level.WRONG)
    assert not list(log({}, misplaced=10).findings(ALL))


def test_a_segment_that_is_found_far_away_is_named_before_and_after() -> None:
    recorded = log({"forearm_left": range(35, 40)})
    for number in range(100, 120):
        recorded.add(number * 10**8, ALL, [], [], found=["pelvis"] if number == 101 else [])
    pelvis, forearm = recorded.findings(ALL)
    assert (pelvis.subject, pelvis.level, numbers(pelvis.what)) == ("pelvis", Level.DOUBTFUL, [9.1, 11.0])
    assert numbers(forearm.what) == [2.5, 3.9]
    for number in (120, 121):
        recorded.add(number * 10**8, ALL, [], [], found=["pelvis"])
    assert numbers(next(recorded.findings(ALL)).what) == [9.1, 12.1], "spans that overlap are one"
