"""Who is refused, since when, and who is told."""

from bodycam_ros.solving.refusal_log import Refusal, RefusalLog

FRAME_NS = 33_333_333
CAMERAS = ("head", "waist")


def log_of(refused: list[set[str]], doubt_after_s: float = 0.1) -> RefusalLog:
    log = RefusalLog(doubt_after_s)
    for frame, cameras in enumerate(refused):
        log.add(dict.fromkeys(CAMERAS, frame * FRAME_NS), cameras)
    return log


def test_a_blink_is_counted_and_nobody_is_told() -> None:
    log = log_of([{"head"}, {"head"}, set(), {"head"}, {"head"}])
    assert log.counts == {"head": 4} and not log.doubted
    log.end()
    assert not log.doubts


def test_who_is_refused_for_long_is_told_from_when_on() -> None:
    log = log_of([set(), {"head"}, {"head", "waist"}, {"head"}, {"head"}, {"head"}])
    assert log.doubted == {"head": Refusal("head", FRAME_NS, 5 * FRAME_NS)}
    assert not log.doubts
    log.add({}, ())  # it is lost
    assert not log.doubted
    assert log.doubts == [Refusal("head", FRAME_NS, 5 * FRAME_NS)]


def test_what_lasts_to_the_end_is_known_in_the_end() -> None:
    log = log_of([{"waist"}] * 5)
    log.end()
    assert log.doubts == [Refusal("waist", 0, 4 * FRAME_NS)] and log.counts == {"waist": 5}
