from collections import Counter

from bodycam_ros.replay.doubted_cameras import doubted_cameras
from bodycam_ros.replay.replay_summary import ReplaySummary
from bodycam_ros.verdict.verdict import Finding, Level, Verdict


def test_cameras_are_looked_at_that_were_lost_or_contradict():
    summary = ReplaySummary(recorded_s=1.0)
    summary.images = Counter(head=100, shin=100, thigh=100)
    summary.registered = Counter(head=98, shin=20, thigh=97)
    summary.verdict = Verdict.of([Finding("thigh", Level.WRONG, "is elsewhere")])
    assert doubted_cameras(summary) == ("shin", "thigh")
