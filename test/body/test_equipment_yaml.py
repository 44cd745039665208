"""What a person writes about a machine: understood, or refused with the place in it."""

import logging
from pathlib import Path

import numpy as np
import pytest
from helpers.known_motion import BODY
from helpers.naming import naming

from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Equipment, fitted_equipment
from bodycam_ros.body.equipment_yaml import equipment_path, read_equipment, supplied_equipment
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


def test_a_turn_in_degrees_stands_for_a_quaternion(tmp_path: Path) -> None:
    turned = SCOOTER.replace("axis: [0, 0, 1]}", "axis: [0, 0, 1], turned_in_parent: [10, 0, 90]}")
    head = read(tmp_path, turned).joints[1]
    np.testing.assert_allclose(head.parent_T_joint[:3, 3], [0.35, 0.0, 0.1])
    # Rolled about the parent's x, then turned about its z: what was forward is left, what was left is back and up.
    sine, cosine = np.sin(np.radians(10.0)), np.cos(np.radians(10.0))
    np.testing.assert_allclose(head.parent_T_joint[:3, :2].T, [[0.0, 1.0, 0.0], [-cosine, 0.0, sine]], atol=1e-12)
    both = turned.replace("turned_in_parent", "orientation_in_parent: [0, 0, 1, 0], turned_in_parent")
    with naming(BodyError, "joint head", "turned_in_parent", "orientation_in_parent"):
        read(tmp_path, both)


@pytest.mark.parametrize(
    ("old", "new", "named"),
    [
        ("name: scooter", "name: 7", ("name",)),
        ("root: deck", "root: dek", ("root", "dek")),
        ("upright: 10", "upright: .nan", ("upright",)),
        ("upright: 10", "upriht: 10", ("upriht",)),
        ("  stem:\n", "  stem:\n  loose:\n", ("segments", "loose")),
        ("  stem:\n", "  stem:\n  deck:\n", ("deck",)),
        ("  stem:\n", "  stem: {stands: true}\n", ("segment stem", "stands")),
        ("{acceleration: 5}", "{acceleration: 0}", ("segment deck", "acceleration")),
        ("{acceleration: 5}", "{stands: true, keeps_speed: true}", ("segment deck",)),
        ("parent: deck, child: stem", "parent: stem, child: stem", ("joint head",)),
        ("unknown: [10, 0, 0]", "unknown: [0.01, 0, 0]", ("joint axle", "unknown")),
        ("  head:", "  grip:", ("grip",)),
        ("equipment: stem", "equipment: stm", ("attachment grip", "stm")),
        ("    weight: 4\n", "", ("attachment stand", "pair 1", "weight")),
        ("weight: 9", "weight: .inf", ("attachment stand", "points[1].weight")),
        ("[125, 0, -82]", "[125, 0, .nan]", ("attachment stand", "points[0].body")),
        ("[125, 0, -82]", "[0.125, 0, -0.082]", ("attachment stand", "pair 1", "body")),
        ("[[0.5, 3.2], [5, .inf]]", "[[0, 2], [1, 3]]", ("attachment push", "holds")),
        ("segment: stem", "segment: foot_left", ("camera lamp", "segment foot_left")),
        ("name: scooter", "name: [scooter", ()),
        ("upright: 10", "upriht: 10", ("did you mean upright",)),
        ("[125, 0, -82]", "[125,5, 0, -82]", ("points[0].body", "decimal point")),
        ("[125, 0, -82]", "[125mm, 0, -82]", ("points[0].body[0]", "without its unit")),
        ("type: hinge", "type: hindge", ("type", "hinge", "weld")),
        ("  stem:", "\tstem:", ("tab", "spaces")),
        ("name: scooter", "name scooter", ("colon",)),
    ],
)  # fmt: skip
def test_a_slip_of_the_pen_is_named_with_its_file(tmp_path: Path, old: str, new: str, named: tuple[str, ...]) -> None:
    assert old in SCOOTER
    with naming(BodyError, "scooter.yaml", *named):
        read(tmp_path, SCOOTER.replace(old, new, 1))


BAR = """name: bar
root: rod
segments: {rod: {}}
attachments:
  left: {body: forearm_left, equipment: rod, weight: 40, unknown: [0, 150, 0],
    points: [{body: [0, 0, -355], equipment: [0, 300, 0]}]}
  right: {body: forearm_right, equipment: rod, weight: 40,
    points: [{body: [0, 0, -355], equipment: [0, -300, 0]}]}
"""


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            "weight: 40,\n",
            "weight: 40, unknown: [10, 90, 0],\n",
            "unknown is above 0 along y in all of them",
        ),
        ("", "", None),
        ("", "centimetres", "within 36 mm"),
    ],
)
def test_what_is_hardly_meant_is_told(
    tmp_path: Path, old: str, new: str, told: str | None, caplog: pytest.LogCaptureFixture
) -> None:
    text = BAR.replace(old, new) if old else BAR
    if new == "centimetres":
        text = text.replace("355", "35.5").replace("300", "30")
    with caplog.at_level(logging.WARNING):
        read(tmp_path, text)
    assert (told in " ".join(caplog.text.split())) if told else not caplog.text


def test_a_segment_may_not_be_named_as_one_of_the_body(tmp_path: Path) -> None:
    with naming(BodyError, "segment torso", BODY.name):
        coupled_body(BODY, read(tmp_path, BAR.replace("rod", "torso")))


def test_equipment_that_nothing_holds_is_refused(tmp_path: Path) -> None:
    with naming(BodyError, tmp_path / "scooter.yaml", "attachments"):
        read(tmp_path, "name: rock\nroot: rock_itself\nsegments: {rock_itself: {}}\nattachments: {}\n")


def test_a_loop_of_its_own_is_closed_by_a_known_joint(tmp_path: Path) -> None:
    loop = "  brace: {parent: stem, child: wheel, type: ball, origin_in_parent: [0, 0, 0]}\nattachments:"
    assert len(read(tmp_path, SCOOTER.replace("attachments:", loop)).joints) == 3
    with naming(BodyError, "joint brace"):
        read(tmp_path, SCOOTER.replace("attachments:", loop.replace("0, 0]}", "0, 0], unknown: [5, 0, 0]}")))


def test_a_body_without_the_segment_does_without_what_is_optional(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    scooter = read(tmp_path)
    with caplog.at_level(logging.WARNING):
        fitted = fitted_equipment(scooter, BODY)
    assert [each.name for each in fitted.attachments] == ["stand", "push"]
    assert "grip (to hand_left)" in caplog.text
    coupled = coupled_body(BODY, scooter)
    assert {"stand", "push"} <= {joint.name for joint in coupled.loop_joints}
    assert "grip" not in {joint.name for joint in coupled.joints}
    with naming(BodyError, "attachment grip", "hand_left"):
        fitted_equipment(read(tmp_path, SCOOTER.replace(", optional: true", "")), BODY)


def test_a_name_is_of_what_is_supplied_and_a_path_is_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    assert "bicycle" in supplied_equipment()
    assert read_equipment("bicycle").name == "bicycle"
    monkeypatch.chdir(tmp_path)
    (tmp_path / "bicycle").write_text(SCOOTER)
    assert equipment_path("bicycle") != Path("bicycle"), "a file beside must not pass for what is supplied"
    assert equipment_path(tmp_path / "bicycle") == tmp_path / "bicycle"
    with naming(BodyError, "unicycle"):
        read_equipment("unicycle")
    (tmp_path / "bike.txt").write_text(SCOOTER)
    with naming(BodyError, "bike.txt"):
        read_equipment("bike.txt")
    with naming(BodyError, "unicycle.yaml"):
        read_equipment("unicycle.yaml")
