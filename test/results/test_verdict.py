"""Findings, their order and level, and the text in which a bag keeps them."""

import json
from dataclasses import replace

import pytest
from helpers.naming import names

from bodycam_ros.results.verdict import (
    Finding,
    Level,
    LimitCheck,
    Verdict,
    check_limits,
    parse_verdict,
    verdict_text,
    worst_level,
)

HEAD = Finding("head", Level.DOUBTFUL, "ends early", "it stopped", "look at it", check="end")
FOOT = Finding(
    "foot_left", Level.WRONG, "contradicts", "its clock is off", "set it", check="contradiction", cause="clock"
)
WHOLE = Finding("", Level.GOOD, "3 lenses", part="recording", check="lens")


def test_the_worst_finding_is_the_level_and_comes_first() -> None:
    verdict = Verdict.from_findings([WHOLE, HEAD, FOOT, replace(FOOT, subject="arm")])
    assert verdict.level is Level.WRONG
    assert [finding.subject for finding in verdict.findings] == ["arm", "foot_left", "head", ""]
    assert verdict.text.startswith("wrong") and names(verdict.text, "foot_left") and names(verdict.text, "arm")
    assert not names(verdict.text, "head"), "it is not what is wrong"
    assert Verdict.from_findings(()).level is Level.GOOD is worst_level(())
    assert Verdict.from_findings(()).text.startswith("good")


def test_each_subject_is_named_once() -> None:
    twice = Verdict.from_findings([HEAD, replace(HEAD, what="is dark")])
    assert twice.text.startswith("doubtful") and twice.text.count("head") == 1


def test_a_verdict_in_a_bag_is_the_verdict() -> None:
    verdict = Verdict.from_findings([HEAD, FOOT, WHOLE])
    assert parse_verdict(verdict_text(verdict)) == verdict
    assert json.loads(verdict_text(verdict))["findings"][0]["cause"] == "clock"


def test_a_verdict_of_before_causes_had_names_is_read() -> None:
    stored = json.loads(verdict_text(Verdict.from_findings([FOOT])))
    del stored["findings"][0]["cause"]
    assert parse_verdict(json.dumps(stored)).findings == (replace(FOOT, cause=""),)


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{}",
        "[]",
        "null",
        '{"findings": [{}]}',
        '{"findings": [{"level": "bad"}]}',
        '{"findings": 3}',
        "[" * 100_000,
    ],
)
def test_other_text_is_no_verdict(text: str) -> None:
    with pytest.raises(ValueError):
        parse_verdict(text)


def test_what_a_finding_says_is_in_one_line() -> None:
    assert "\n" not in FOOT.text
    for part in ("camera foot_left", FOOT.what, FOOT.why, FOOT.remedy):
        assert names(FOOT.text, part)
    assert WHOLE.text == WHOLE.what


def test_a_limit_is_checked_of_each_camera_and_summed_up_for_all() -> None:
    rows = [
        LimitCheck[float](
            "rate", lambda hz: hz, 20.0, 5.0, "{:.0f} a second", "more light", "{:.0f} to {:.0f} a second"
        )
    ]
    found = list(check_limits({"a": 30.0, "b": 10.0, "c": 2.0, "d": float("nan")}, rows))
    assert [(f.subject, f.level) for f in found] == [
        ("b", Level.DOUBTFUL),
        ("c", Level.WRONG),
        ("", Level.GOOD),
    ]
    assert names(found[0].what, 10) and found[0].remedy == "more light" and found[0].check == "rate"
    assert names(found[2].what, 2) and names(found[2].what, 30), "what cannot be measured is no part of the range"
    assert list(check_limits({"d": float("nan")}, rows)) == []
