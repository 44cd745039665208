"""Documents that are not to be believed."""

import pytest

from bodycam_ros.body.urdf import body_from_urdf
from bodycam_ros.body.urdf_xml import MAX_LETTERS
from bodycam_ros.errors import BodyError

TENFOLD = '<!ENTITY l{} "{}">'
LAUGHS = "".join(TENFOLD.format(n, 10 * f"&l{n - 1};") for n in range(1, 12))


@pytest.mark.parametrize(
    "text",
    [
        f'<!DOCTYPE robot [<!ENTITY l0 "ha">{LAUGHS}]><robot name="&l11;"/>',
        '<!DOCTYPE robot [<!ENTITY f SYSTEM "/etc/hostname">]><robot><link name="&f;"/></robot>',
        "<robot>" + "<link>" * 100_000,
        "<robot>" + " " * MAX_LETTERS + "</robot>",
        "<robot name='\ud800'/>",
        "<robot/><robot/>",
    ],
    ids=["laughs", "file", "deep", "long", "surrogate", "two"],
)
def test_what_could_stand_for_anything_or_never_ends_is_refused(text: str) -> None:
    with pytest.raises(BodyError):
        body_from_urdf(text)
