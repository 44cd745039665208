import pytest

from bodycam_ros.shown import printable, shown


def test_ordinary_values_are_shown_as_python_writes_them() -> None:
    for value in (7, "seven", 0.1, None, True, [1, 2], {"a": 1}):
        assert shown(value) == repr(value)


def test_what_is_long_deep_or_repeated_is_cut_short() -> None:
    bomb: list[object] = [0] * 9
    for _ in range(40):
        bomb = [bomb] * 9
    for value in (bomb, "x" * 1_000_000, 10**10_000, list(range(10_000)), {n: n for n in range(1000)}):
        assert len(shown(value)) < 500


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("knee 30°, naïve: 膝\n\tyes", "knee 30°, naïve: 膝\n\tyes"),
        ("\x1b[2J\x1b]0;title\x07", "\\x1b[2J\\x1b]0;title\\x07"),
        ("\x9b31m\r\x00", "\\x9b31m\\r\\x00"),
        ("\u202egpj.exe", "\\u202egpj.exe"),
        ("latin-\udcfc", "latin-\\udcfc"),
    ],
)
def test_what_a_terminal_would_obey_is_written_out(text: str, expected: str) -> None:
    assert printable(text) == expected
    printable(text).encode()
