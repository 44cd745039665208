"""Detection of people: what the numbers of its networks mean, and how they are asked, by discs in place of joints."""

from collections.abc import Mapping
from pathlib import Path

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.camera.camera_image import read_image_file
from bodycam_ros.errors import BodyError
from bodycam_ros.formats.keypoints import JOINTS
from bodycam_ros.geometry import Array
from bodycam_ros.static_cameras import blazepose
from bodycam_ros.static_cameras.blazepose import LANDMARKS, PoseDetector, Square, decode_boxes, suppress_boxes
from bodycam_ros.static_cameras.detected_people import DetectedPeople

HIPS, CIRCLE = 33, 34
PICTURE = Path(__file__).parents[2] / "docs/outside.jpg"


def colour(row: int) -> tuple[int, int, int]:
    """Red, green, blue of a landmark's disc."""
    return 60 + 40 * (row % 5), 60 + 40 * (row // 5 % 5), 60 + 80 * (row // 25)


def middle(crop: Array, row: int) -> Array | None:
    """Middle of a landmark's disc in an image (H, W, 3) [px], if it has one."""
    y, x = np.nonzero(np.abs(crop - colour(row)).max(axis=2) < 12.0)
    return np.array([x.mean(), y.mean()]) if len(x) else None


def find_discs(image: NDArray[np.float32]) -> Mapping[tuple[int, ...], Array]:
    """What the network of landmarks would say of discs."""
    crop, values = 255.0 * image[0], np.zeros((39, 5))
    places = {row: middle(crop, row) for row in (*LANDMARKS, HIPS, CIRCLE)}
    for row, place in places.items():
        if place is not None:
            values[row] = [*(place + 0.5), 0.0, 5.0, 5.0]
    is_person = places[HIPS] is not None and places[CIRCLE] is not None
    return {(1, 195): values.reshape(1, 195), (1, 1): np.array([[float(is_person)]])}


def find_boxes(image: NDArray[np.float32]) -> Mapping[tuple[int, ...], Array]:
    """What the detector would say: the anchor of the first cell, if hips and circle are in the image."""
    crop = 127.5 * (image[0] + 1.0)
    hips, circle = middle(crop, HIPS), middle(crop, CIRCLE)
    values, scores = np.zeros((1, 2254, 12)), np.full((1, 2254, 1), -50.0)
    if hips is not None and circle is not None:
        scores[0, 0] = 3.0
        first = 224.0 * 0.5 / 28.0
        values[0, 0] = [*(hips - first), 60.0, 60.0, *(hips + 0.5 - first), *(circle + 0.5 - first), 0, 0, 0, 0]
    return {(1, 2254, 12): values, (1, 2254, 1): scores}


def painted_person(turn: float, hips: Array, size: float) -> tuple[NDArray[np.uint8], Array]:
    """An image with the discs of a person who leans by an angle, and the places (12, 2) of the joints."""
    R = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    upright = {HIPS: (0.0, 0.0), CIRCLE: (0.0, -1.0)}
    upright |= {row: (0.25 * (-1) ** k, 0.75 - 0.27 * (k // 2)) for k, row in enumerate(LANDMARKS)}
    image = np.zeros((900, 1300, 3), np.uint8)
    places = {row: hips + size * R @ np.array(at) for row, at in upright.items()}
    for row, at in places.items():
        places[row] = at.round()
        cv2.circle(image, (int(places[row][0]), int(places[row][1])), 13, colour(row)[::-1], -1)
    return image, np.array([places[row] for row in LANDMARKS])


@pytest.mark.parametrize("turn", [0.0, 0.6, -2.5])
def test_joints_are_where_they_are_in_the_image(turn: float) -> None:
    image, places = painted_person(turn, np.array([640.0, 430.0]), 260.0)
    [person] = PoseDetector(find_boxes, find_discs).detect(image)
    assert np.linalg.norm(person[:, :2] - places, axis=1).max() < 1.5
    assert (person[:, 2] > 0.99).all()


def test_joints_that_are_not_in_the_image_have_no_score() -> None:
    image, places = painted_person(0.0, np.array([640.0, 430.0]), 260.0)
    gone = int(np.argmax(places[:, 1]))
    cv2.circle(image, tuple(places[gone].astype(int).tolist()), 14, (0, 0, 0), -1)
    [person] = PoseDetector(find_boxes, find_discs).detect(image)
    assert set(np.flatnonzero(person[:, 2] < 0.6).tolist()) == {gone}


def test_an_empty_image_has_nobody() -> None:
    assert PoseDetector(find_boxes, find_discs).detect(np.zeros((480, 640, 3), np.uint8)) == []


@pytest.mark.parametrize("turn", [0.0, -2.5])
def test_a_predicted_person_is_found_without_a_search(turn: float) -> None:
    def search(image: NDArray[np.float32]) -> Mapping[tuple[int, ...], Array]:
        raise AssertionError("the whole image is searched")

    image, places = painted_person(turn, np.array([640.0, 430.0]), 260.0)
    people = DetectedPeople(PoseDetector(search, find_discs))
    predicted = places + np.random.default_rng(3).normal(0.0, 20.0, places.shape)
    [person] = people.people("cam", 0, image, predicted)
    assert np.linalg.norm(person[:, :2] - places, axis=1).max() < 1.5
    assert people.people("cam", 0, np.zeros_like(image), predicted) == ()
    predicted[LANDMARKS.index(23)] = np.nan
    assert people.people("cam", 0, image, predicted) == (), "a hip is out of the lens's cone"


def test_the_square_about_predicted_joints_has_all_of_them_and_the_head() -> None:
    _, places = painted_person(0.4, np.array([640.0, 430.0]), 260.0)
    square = Square.of_joints(places)
    assert square is not None
    reach = np.linalg.norm(square.up)
    assert np.linalg.norm(places - square.centre, axis=1).max() < reach
    assert np.linalg.norm(places[:2].mean(axis=0) - square.centre) < 0.6 * reach


@pytest.mark.parametrize(
    ("anchor", "centre"), [(0, (0.5 / 28, 0.5 / 28)), (3, (1.5 / 28, 0.5 / 28)), (1568, (0.5 / 14, 0.5 / 14)),
                           (1568 + 392, (0.5 / 7, 0.5 / 7)), (2253, (6.5 / 7, 6.5 / 7))],
)  # fmt: skip
def test_a_box_is_told_from_its_anchor(anchor: int, centre: tuple[float, float]) -> None:
    values, scores = np.zeros((2254, 12)), np.full(2254, -3.0)
    scores[anchor] = 2.0
    values[anchor] = [11.2, -11.2, 44.8, 22.4, 22.4, 0.0, 0.0, -22.4, 9.0, 9.0, 9.0, 9.0]
    [box] = decode_boxes(values, scores)
    x, y = centre
    expected = [1.0 / (1.0 + np.exp(-2.0)), x - 0.05, y - 0.1, x + 0.15, y, x + 0.1, y, x, y - 0.1]
    np.testing.assert_allclose(box, expected, atol=1e-9)


def test_boxes_of_one_person_are_one_and_those_of_two_are_two() -> None:
    def box(score: float, left: float) -> list[float]:
        return [score, left, 0.0, left + 10.0, 20.0, 0.0, 0.0, 0.0, 0.0]

    kept = suppress_boxes(np.array([box(0.7, 1.0), box(0.9, 0.0), box(0.8, 9.0)]))
    assert kept[:, 0].tolist() == [0.9, 0.8]
    assert len(suppress_boxes(np.empty((0, 9)))) == 0


def test_without_the_extra_it_is_said_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(blazepose, "find_spec", lambda name: None)
    with pytest.raises(BodyError) as refused:
        PoseDetector.installed()
    assert 'pip install "bodycam_ros[pose]" && pip install --no-deps mediapipe==0.10.21' in str(refused.value)


def test_the_installed_networks_find_a_rendered_cyclist() -> None:
    try:
        detector = PoseDetector.installed()
    except BodyError as error:
        pytest.skip(str(error))
    picture = read_image_file(PICTURE, cv2.IMREAD_COLOR)[563:1036, 492:966]  # of the fourth camera
    people = detector.detect(picture)
    assert len(people) == 1
    by_eye = {
        "LShoulder": (745, 680), "RShoulder": (672, 678), "LElbow": (775, 735), "LHip": (715, 780), "RHip": (660, 780),
        "LKnee": (755, 822), "RKnee": (663, 880), "LAnkle": (705, 890), "RAnkle": (660, 965),
    }  # fmt: skip
    found = {joint: people[0][JOINTS.index(joint), :2] + [492.0, 563.0] for joint in by_eye}
    off = {joint: float(np.linalg.norm(found[joint] - at)) for joint, at in by_eye.items()}
    assert max(off.values()) < 25.0, off
