"""What static cameras did not see makes a result doubtful."""

from bodycam_ros.verdict.outside_findings import SeenSegments
from bodycam_ros.verdict.verdict import Level, Verdict


def test_a_segment_that_is_seldom_seen_is_named() -> None:
    seen = SeenSegments()
    for instant in range(10):
        seen.add(["pelvis", "hand_left"] if instant < 4 else ["pelvis"])
    findings = seen.findings(["pelvis", "hand_left", "head"])
    assert [(finding.camera, finding.level) for finding in findings] == [
        ("hand_left", Level.DOUBTFUL),
        ("head", Level.DOUBTFUL),
    ]
    assert findings[0].text.startswith("segment hand_left: static cameras saw it at 40%")
    assert "head" in Verdict.of(findings).text


def test_what_others_see_is_not_asked_for() -> None:
    seen = SeenSegments()
    seen.add(["pelvis"])
    assert seen.findings(["pelvis"]) == ()


def test_without_static_cameras_nothing_is_found() -> None:
    assert SeenSegments().findings(["pelvis"]) == ()
