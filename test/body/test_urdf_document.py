"""Documents that are not to be believed."""

import pytest

from bodycam_ros.body.urdf_document import UrdfDocument
from bodycam_ros.body.urdf_xml import MAX_LETTERS
from bodycam_ros.errors import BodyError

TENFOLD = '<!ENTITY l{} "{}">'
LAUGHS = "".join(TENFOLD.format(n, 10 * f"&l{n - 1};") for n in range(1, 12))


def chain(links: int, backwards: bool = False) -> str:
    listed = [f'<link name="l{n}"/>' for n in range(links)]
    joints = [
        f'<joint name="j{n}" type="fixed"><parent link="l{n - 1}"/><child link="l{n}"/></joint>'
        for n in range(1, links)
    ]
    return f"<robot>{''.join(listed)}{''.join(joints[::-1] if backwards else joints)}</robot>"


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
        UrdfDocument.parse(text)


def test_joints_come_parents_first_and_else_as_they_are_listed() -> None:
    document = UrdfDocument.parse(chain(5, backwards=True))
    assert [joint.name for joint in document.joints] == ["j1", "j2", "j3", "j4"]
    star = chain(4).replace('parent link="l1"', 'parent link="l0"').replace('parent link="l2"', 'parent link="l0"')
    swapped = star.replace("j1", "?").replace("j3", "j1").replace("?", "j3")
    assert [joint.name for joint in UrdfDocument.parse(swapped).joints] == ["j3", "j2", "j1"]
