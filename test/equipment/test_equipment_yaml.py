"""What a person writes about a machine: understood, or refused with the place in it."""

import logging
from pathlib import Path

import numpy as np
import pytest
from known_motion import BODY

from bodycam_ros.equipment.coupled_body import coupled_body
from bodycam_ros.equipment.equipment import Equipment
from bodycam_ros.equipment.equipment_yaml import read_equipment
from bodycam_ros.equipment.fitted_equipment import fitted_equipment
from bodycam_ros.equipment.supplied_equipment import equipment_path, supplied_equipment
from bodycam_ros.errors import BodyError

SCOOTER = """
name: scooter
root: deck
upright: 10
segments:
  deck: {acceleration: 5}
  wheel: {keeps_speed: true, angular_acceleration: 3e1}
  stem:
joints:
  axle: {parent: deck, child: wheel, type: hinge, origin_in_parent: [0.4, 0, 0.1], axis: [0, 1, 0], unknown: [10, 0, 0]}
  head: {parent: deck, child: stem, type: hinge, origin_in_parent: [0.35, 0, 0.1], axis: [0, 0, 1]}
attachments:
  stand:
    body: foot_right
    equipment: deck
    weight: 4
    unknown: [50, 20, 0]
    points: [{body: [125, 0, -82], equipment: [100, 0, 0]}, {body: [-50, 0, -82], equipment: [-75, 0, 0], weight: 9}]
  push: {body: foot_left, equipment: deck, holds: [[0.5, 3.2], [5, .inf]],
    points: [{body: [0, 0, 0], equipment: [0, 0, 0], weight: 1}]}
  grip: {body: hand_left, equipment: stem, weight: 10, holds: always, optional: true,
    points: [{body: [0, 0, -80], equipment: [0, 200, 900]}]}
cameras:
  lamp: {segment: stem, position: [0, 0, 0.9], quaternion_xyzw: [0, 0, 0, 1]}
"""


def read(tmp_path: Path, text: str = SCOOTER) -> Equipment:
    path = tmp_path / "scooter.yaml"
    path.write_text(text)
    return read_equipment(path)


def test_what_a_person_writes_is_understood(tmp_path: Path) -> None:
    scooter = read(tmp_path)
    assert (scooter.name, scooter.root, tuple(scooter.segments)) == ("scooter", "deck", ("deck", "wheel", "stem"))
    wheel, deck = scooter.segments["wheel"], scooter.segments["deck"]
    assert (wheel.keeps_speed, wheel.angular_acceleration_sigma, wheel.acceleration_sigma) == (True, 30.0, None)
    assert (deck.keeps_speed, deck.stands, deck.acceleration_sigma) == (False, False, 5.0)
    assert scooter.upright_sigma == pytest.approx(np.radians(10.0))
    assert [joint.name for joint in scooter.joints] == ["axle", "head"]
    assert list(scooter.mounts) == ["lamp"]


def test_millimetres_become_metres(tmp_path: Path) -> None:
    scooter = read(tmp_path)
    stand, push, grip = scooter.attachments
    np.testing.assert_allclose(stand.on_body, [[0.125, 0.0, -0.082], [-0.05, 0.0, -0.082]])
    np.testing.assert_allclose(stand.on_equipment, [[0.1, 0.0, 0.0], [-0.075, 0.0, 0.0]])
    np.testing.assert_allclose(stand.sigmas, [0.004, 0.009])
    np.testing.assert_allclose(stand.unknown, [0.05, 0.02, 0.0])
    np.testing.assert_allclose(push.unknown, 0.0)
    np.testing.assert_allclose(scooter.unknown["axle"], [0.01, 0.0, 0.0])
    assert (stand.body_segment, stand.equipment_segment, grip.body_segment) == ("foot_right", "deck", "hand_left")


def test_it_holds_when_it_is_said_to(tmp_path: Path) -> None:
    stand, push, grip = read(tmp_path).attachments
    assert (stand.intervals, stand.detected) == (None, True)
    assert (grip.intervals, grip.detected) == (None, False)
    assert (push.intervals, push.detected) == (((0.5, 3.2), (5.0, np.inf)), False)
    assert [push.holds_at(seconds) for seconds in (0.0, 1.0, 4.0, 1e6)] == [False, True, False, True]


def test_a_turn_in_degrees_stands_for_a_quaternion(tmp_path: Path) -> None:
    turned = SCOOTER.replace("axis: [0, 0, 1]}", "axis: [0, 0, 1], turned_in_parent: [10, 0, 90]}")
    head = read(tmp_path, turned).joints[1]
    np.testing.assert_allclose(head.parent_T_joint[:3, 3], [0.35, 0.0, 0.1])
    # Rolled about the parent's x, then turned about its z: what was forward is left, what was left is back and up.
    sine, cosine = np.sin(np.radians(10.0)), np.cos(np.radians(10.0))
    np.testing.assert_allclose(head.parent_T_joint[:3, :2].T, [[0.0, 1.0, 0.0], [-cosine, 0.0, sine]], atol=1e-12)
    both = turned.replace("turned_in_parent", "orientation_in_parent: [0, 0, 0, 1], turned_in_parent")
    with pytest.raises(BodyError, match="joint head: has turned_in_parent and orientation_in_parent"):
        read(tmp_path, both)


def test_little_need_be_said(tmp_path: Path) -> None:
    bar = read(
        tmp_path,
        """
name: stick
root: bar
segments: {bar: {}}
attachments:
  grip: {body: forearm_left, equipment: bar, weight: 40, points: [{body: [0, 0, -355], equipment: [0, 0, 0]}]}
""",
    )
    assert (bar.joints, dict(bar.mounts), dict(bar.unknown), bar.upright_sigma) == ((), {}, {}, np.inf)


@pytest.mark.parametrize(
    ("old", "new", "complaint"),
    [
        ("name: scooter", "name: 7", "name must be a name, not 7"),
        ("root: deck", "", "an equipment file: lacks root"),
        ("root: deck", "root: dek", "root dek is not among the segments"),
        ("upright: 10", "upright: -1", r"upright \[deg\] must be a number from 0.01 to 90, not -1"),
        ("upright: 10", "upright: .nan", r"upright \[deg\] must be a number"),
        ("upright: 10", "upriht: 10", "unknown 'upriht'"),
        ("  stem:\n", "  stem:\n  loose:\n", "segments loose do not hang on root deck"),
        ("  stem:\n", "  stem:\n  foot_left:\n", "attachment push: body foot_left is a segment of the equipment"),
        ("  stem:\n", "  stem:\n" + "".join(f"  s{i}:\n" for i in range(98)), "segments: 101 are more than"),
        ("  stem:\n", "  stem:\n  deck:\n", "line 9: 'deck' is listed twice"),
        ("{acceleration: 5}", "{acceleration: 0}", "segment deck: acceleration must be a number from 0.01 to 1"),
        ("{acceleration: 5}", "{acceleration: fast}", "segment deck: acceleration must be a number"),
        ("root: deck", "root: scooter", "root scooter is not among the segments deck, wheel, stem"),
        ("{acceleration: 5}", "{stand: true}", "segment deck: has unknown 'stand'; known are .*stands"),
        ("  stem:\n", "  stem: {stands: true}\n", "segment stem: stands, which only the root deck can"),
        ("{acceleration: 5}", "{stands: 5}", "segment deck: stands must be true or false, not 5"),
        ("{acceleration: 5}", "{stands: true, keeps_speed: true}", "segment deck: it stands, and so has no keeps"),
        ("parent: deck, child: stem", "parent: stem, child: stem", "joint head: joins segment stem to itself"),
        ("parent: deck, child: stem", "parent: deck, child: wheel", "segments stem do not hang on root deck"),
        ("axis: [0, 0, 1]}", "axis: [0, 0, 1], unknwn: 3}", "joint head: has unknown 'unknwn'; known are .*unknown"),
        ("unknown: [10, 0, 0]", "unknown: [-10, 0, 0]", "joint axle: unknown must be 0 to 100000 mm"),
        ("unknown: [10, 0, 0]", "unknown: [0.01, 0, 0]", "joint axle: unknown is in millimetres.*looks like metres"),
        ("unknown: [10, 0, 0]", "unknown: [10, 0]", "joint axle: unknown must be a list of 3 finite numbers"),
        ("  head:", "  grip:", "grip: names must differ"),
        ("  grip:", "  scooter:", "scooter: names must differ"),
        ("equipment: stem", "equipment: stm", "attachment grip: equipment stm is not among the segments deck"),
        ("body: hand_left", "body: 5", "attachment grip: body must be a name, not 5"),
        ("    weight: 4\n", "", "attachment stand: pair 1: lacks weight"),
        ("weight: 9", "weight: -9", r"attachment stand: pair 2: weight \[mm\] must be a number from 0.1 to"),
        ("weight: 9", "weight: .inf", r"attachment stand: pair 2: weight \[mm\] must be"),
        ("weight: 9", "wight: 9", "attachment stand: pair 2: has unknown 'wight'"),
        (", equipment: [100, 0, 0]", "", "attachment stand: pair 1: lacks equipment"),
        ("[125, 0, -82]", "[125, 0]", "attachment stand: pair 1: body must be a list of 3 finite numbers"),
        ("[125, 0, -82]", "[125, 0, .nan]", "attachment stand: pair 1: body must be a list of 3 finite numbers"),
        ("[125, 0, -82]", "[0.125, 0, -0.082]", "attachment stand: pair 1: body is in millimetres.*looks like metres"),
        ("[125, 0, -82]", "[2e5, 0, 0]", "attachment stand: pair 1: body is 200000 mm from the segment's origin"),
        ("[{body: [0, 0, -80], equipment: [0, 200, 900]}]", "[]", "attachment grip: points must be a list of 1 to 100"),
        ("[[0.5, 3.2], [5, .inf]]", "[[3.2, 0.5]]", r"attachment push: holds: an interval is .*not \[3.2, 0.5\]"),
        ("[[0.5, 3.2], [5, .inf]]", "[0.5, 3.2]", "attachment push: holds: an interval is .*not 0.5"),
        ("[[0.5, 3.2], [5, .inf]]", "[[0, 2], [1, 3]]", "attachment push: holds: its intervals must follow"),
        ("[[0.5, 3.2], [5, .inf]]", "sometimes", "attachment push: holds must be detected, always, or a"),
        ("optional: true", "optional: maybe", "attachment grip: optional must be true or false, not 'maybe'"),
        ("segment: stem", "segment: foot_left", "camera lamp: segment foot_left is not among the segments"),
        ("name: scooter", "name: [scooter", "not YAML"),
    ],
)  # fmt: skip
def test_a_slip_of_the_pen_is_named_with_its_file(tmp_path: Path, old: str, new: str, complaint: str) -> None:
    assert old in SCOOTER
    with pytest.raises(BodyError, match=rf"scooter\.yaml: .*{complaint}"):
        read(tmp_path, SCOOTER.replace(old, new, 1))


def test_only_comments_after_a_name_are_an_empty_table(tmp_path: Path) -> None:
    start = SCOOTER.index("cameras:")
    assert not read(tmp_path, SCOOTER[:start] + "cameras:\n  # lamp: not today\n").mounts
    with pytest.raises(BodyError, match="cameras must be a table of names, not 0"):
        read(tmp_path, SCOOTER[:start] + "cameras: 0\n")


def test_equipment_that_nothing_holds_is_refused(tmp_path: Path) -> None:
    with pytest.raises(BodyError, match="nothing would couple a body to it"):
        read(tmp_path, "name: rock\nroot: rock_itself\nsegments: {rock_itself: {}}\nattachments: {}\n")


def test_a_loop_of_its_own_is_closed_by_a_known_joint(tmp_path: Path) -> None:
    loop = "  brace: {parent: stem, child: wheel, type: ball, origin_in_parent: [0, 0, 0]}\nattachments:"
    assert len(read(tmp_path, SCOOTER.replace("attachments:", loop)).joints) == 3
    with pytest.raises(BodyError, match="joint brace: unknown is for joints that carry their child"):
        read(tmp_path, SCOOTER.replace("attachments:", loop.replace("0, 0]}", "0, 0], unknown: [5, 0, 0]}")))


def test_a_body_without_the_segment_does_without_what_is_optional(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    scooter = read(tmp_path)
    with caplog.at_level(logging.WARNING):
        fitted = fitted_equipment(scooter, BODY)
    assert [each.name for each in fitted.attachments] == ["stand", "push"]
    assert "attachment grip is left out: body subject has no hand_left" in caplog.text
    coupled = coupled_body(BODY, scooter)
    assert {"stand", "push"} <= {joint.name for joint in coupled.loop_joints}
    assert "grip" not in {joint.name for joint in coupled.joints}
    with pytest.raises(
        BodyError, match="scooter: attachment grip is to segment hand_left, which body subject does not"
    ):
        fitted_equipment(read(tmp_path, SCOOTER.replace(", optional: true", "")), BODY)


def test_a_name_is_of_what_is_supplied_and_a_path_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "bicycle" in supplied_equipment()
    assert read_equipment("bicycle").name == "bicycle"
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bicycle").write_text(SCOOTER)
    assert equipment_path("bicycle") != Path("bicycle"), "a file beside must not pass for what is supplied"
    assert equipment_path(tmp_path / "bicycle") == tmp_path / "bicycle"
    with pytest.raises(
        BodyError, match=r"equipment unicycle: none of that name is supplied; there are .*bicycle.*unicycle\.yaml"
    ):
        read_equipment("unicycle")
    (tmp_path / "bike.txt").write_text(SCOOTER)
    with pytest.raises(BodyError, match=r"^bike\.txt: an equipment file must end in \.yaml; name it bike\.yaml"):
        read_equipment("bike.txt")
    with pytest.raises(BodyError, match=r"^no equipment is named; there are .*bicycle"):
        read_equipment("")
    with pytest.raises(BodyError, match=r"unicycle\.yaml: cannot read this equipment file: No such file"):
        read_equipment("unicycle.yaml")
