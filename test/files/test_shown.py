"""What messages say of values and names that came from a file or a person."""

import pytest

from bodycam_ros.files.shown import other_than

_SEGMENTS = "pelvis", "thigh_left", "thigh_right", "shin_left"


@pytest.mark.parametrize(
    ("name", "known", "said"),
    [
        ("tigh_left", _SEGMENTS, "did you mean thigh_left?"),
        ("Pelvis", _SEGMENTS, "did you mean pelvis?"),
        ("wheel", _SEGMENTS, "there are pelvis, thigh_left, thigh_right, shin_left"),
        (7, _SEGMENTS, "there are pelvis, thigh_left, thigh_right, shin_left"),
        ("head", (), "there are none"),
        ("hea\x1b", ("hea\x1b[31m",), "did you mean hea\\x1b[31m?"),
    ],
)
def test_an_unknown_name_is_answered_with_the_one_that_was_meant(
    name: object, known: tuple[str, ...], said: str
) -> None:
    assert other_than(name, known) == said
