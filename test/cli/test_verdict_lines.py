"""The verdict on a terminal: coloured, the worst first, and said by the exit code."""

from io import StringIO

import pytest

from bodycam_ros.cli.verdict_lines import camera_styles, exit_code, print_verdict
from bodycam_ros.terminal import Terminal
from bodycam_ros.verdict.verdict import Finding, Level, Verdict

BAD = Verdict.of(
    [
        Finding("head", Level.DOUBTFUL, "ends early", "it stopped"),
        Finding("shin\x1b[2J", Level.WRONG, "contradicts the body", "its lens is wrong", "calibrate it"),
        Finding("head", Level.WRONG, "contradicts the body"),
    ]
)


def printed(verdict: Verdict) -> str:
    text = StringIO()
    print_verdict(Terminal(file=text, force_terminal=True, color_system="standard", width=60), verdict)
    return text.getvalue()


@pytest.mark.parametrize(
    ("verdict", "code"), [(Verdict.of([]), 0), (Verdict.of([Finding("a", Level.DOUBTFUL, "odd")]), 0), (BAD, 3)]
)
def test_only_a_wrong_result_has_an_exit_code_of_its_own(verdict: Verdict, code: int) -> None:
    assert exit_code(verdict) == code


def test_a_line_for_each_finding_and_the_verdict_last() -> None:
    lines = printed(BAD).splitlines()
    assert len(lines) == 4
    assert "camera head: contradicts the body" in lines[0] and "\x1b[1;31mwrong: " in lines[0]
    assert "contradicts the body; likely its lens is wrong; calibrate it" in lines[1]
    assert "ends early; likely it stopped" in lines[2] and "\x1b[33mdoubtful: " in lines[2]
    assert "verdict: wrong: do not use this result; head, shin" in lines[3]


def test_a_good_verdict_is_green() -> None:
    assert printed(Verdict.of([])) == "\x1b[32mverdict: good: nothing contradicts the body\x1b[0m\n"


def test_names_do_not_steer_the_terminal() -> None:
    assert "\x1b[2J" not in printed(BAD)


def test_a_cameras_row_has_the_colour_of_its_worst_finding() -> None:
    assert camera_styles(BAD)["head"] == "bold red"
