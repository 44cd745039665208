"""The verdict on a solved bag: the body as it was published, and what does not fit it."""

from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from known_walk import Walk, write_solved

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel, CameraMount
from bodycam_ros.body.urdf import urdf_text
from bodycam_ros.evaluate.evaluation import evaluate
from bodycam_ros.evaluate.report import write_report
from bodycam_ros.evaluate.solved_verdict import published_body, solved_verdict
from bodycam_ros.evaluate.summary import summary
from bodycam_ros.evaluate.summary_picture import verdict_line
from bodycam_ros.geometry import rigid
from bodycam_ros.quality.contradiction import camera_links
from bodycam_ros.results.solved_recording import read_solved
from bodycam_ros.results.urdf_tree import UrdfTree
from bodycam_ros.verdict import Finding, Level, Verdict, parse_verdict, verdict_text


def assert_same_links(published: BodyModel, body: BodyModel) -> None:
    """All that a verdict asks of a body: where cameras are and what lies between them."""
    cameras = tuple(body.mounts)
    assert published.root == body.root
    ours = {(link.first, link.second): link for link in camera_links(published, published.mounts, cameras)}
    theirs = {(link.first, link.second): link for link in camera_links(body, body.mounts, cameras)}
    assert set(ours) == set(theirs)
    for pair, link in theirs.items():
        np.testing.assert_allclose(ours[pair].lengths, link.lengths, atol=1e-9)
        for camera in pair:
            np.testing.assert_allclose(ours[pair].end(camera), link.end(camera), atol=1e-9)


def test_the_published_body_is_the_one_that_was_solved(walk: Walk, ride: Walk, rider: BodyModel, sample: Path) -> None:
    for body in (walk.body, ride.body, rider, read_body(sample / "body.yaml")):
        tree = replace(body, joints=body.tree_joints)
        assert_same_links(published_body(UrdfTree.parse(urdf_text(tree), "a test")), tree)


def test_a_base_link_without_a_shape_still_carries_the_body(walk: Walk) -> None:
    robot = ElementTree.fromstring(urdf_text(walk.body))
    base = next(link for link in robot.iterfind("link") if link.attrib["name"] == walk.body.root)
    for shape in base.findall("visual"):
        base.remove(shape)
    tree = UrdfTree.parse(ElementTree.tostring(robot, encoding="unicode"), "a test")
    assert walk.body.root not in tree.segments
    assert_same_links(published_body(tree), walk.body)


def test_a_camera_on_equipment_is_not_held_against_the_body_that_it_stands_beside(ride: Walk) -> None:
    published = published_body(UrdfTree.parse(urdf_text(ride.body), "a test"))
    assert [joint.name for joint in published.joints if joint.type == "free"] == ["pelvis-frame"]
    pairs = {(link.first, link.second) for link in camera_links(published, published.mounts, tuple(published.mounts))}
    assert pairs == {("waist", "shin")}


def test_a_good_walk_is_good(solved: Path) -> None:
    evaluation = evaluate(solved)
    assert (evaluation.verdict.level, evaluation.verdict.findings) == (Level.GOOD, ())
    assert summary(evaluation)["verdict"] == {
        "level": "good",
        "text": "good: nothing contradicts the body",
        "findings": [],
    }


def test_the_verdict_of_the_replay_is_repeated(solved: Path) -> None:
    missed = Verdict.from_findings([Finding("torso", Level.DOUBTFUL, "was seen too rarely", part="segment")])
    stored = replace(read_solved(solved), stored_verdict=parse_verdict(verdict_text(missed)))
    assert solved_verdict(stored, {}) == missed


def test_a_camera_far_from_where_the_body_has_it_makes_a_result_wrong(walk: Walk, tmp_path: Path) -> None:
    elsewhere = walk.body.mounts["shin"].segment_T_camera @ rigid(np.eye(3), np.array([0.0, 0.4, 0.0]))
    body = replace(walk.body, mounts={**walk.body.mounts, "shin": CameraMount("shin_left", elsewhere)})
    evaluation = evaluate(write_solved(walk, tmp_path / "out", published=body))
    assert evaluation.verdict.level == Level.WRONG
    write_report(evaluation, tmp_path / "report")
    finding = summary(evaluation)["verdict"]["findings"][0]
    assert (finding["subject"], finding["level"]) == ("shin", "wrong")


@pytest.mark.parametrize("level", [Level.DOUBTFUL, Level.WRONG])
def test_the_line_in_the_picture_names_camera_and_cause_and_is_not_too_long(level: Level) -> None:
    short = Verdict.from_findings([Finding("head", level, "is odd", "its lens is wrong")])
    assert verdict_line(short).startswith(level.word)
    assert verdict_line(short).endswith("head (head: its lens is wrong)")
    many = Verdict.from_findings(
        [Finding(f"camera_{number}", level, "is odd", "its lens is wrong") for number in range(40)]
    )
    assert len(verdict_line(many)) == 150
