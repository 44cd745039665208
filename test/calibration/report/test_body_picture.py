from dataclasses import replace
from itertools import combinations

import cv2
import numpy as np
import pytest
from known_calibration import (
    SHORT_THIGH,
    STIFF_JOINT,
    calibrated_body,
    good_diagnosis,
    words,
    worrying_diagnosis,
)
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.calibration.report.body_picture import body_figure, body_png
from bodycam_ros.calibration.report.standing_body import StandingBody
from bodycam_ros.drawing.picture_style import WARNING


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return calibrated_body()


@pytest.fixture(scope="module")
def worrying(body: BodyModel) -> Figure:
    return body_figure(body, worrying_diagnosis(body))


@pytest.fixture(scope="module")
def legs(body: BodyModel) -> BodyModel:
    """A pelvis with a leg and a thigh, as the range of motion that the repository carries shows them."""
    kept = ("pelvis", "thigh_left", "shin_left", "thigh_right")
    return replace(
        body,
        segments=kept,
        joints=tuple(joint for joint in body.joints if {joint.parent, joint.child} <= set(kept)),
        mounts={camera: mount for camera, mount in body.mounts.items() if mount.segment in kept},
    )


def texts(figure: Figure) -> list[Text]:
    """All that a person can read in it."""
    figure.canvas.draw()
    unseen = set()
    for axes in figure.axes:
        low, high = axes.get_xlim()
        # Matplotlib keeps labels that it does not draw: beyond the ends of an axis, and where axes are switched off.
        unseen |= {label for label in axes.get_xticklabels() if not low <= label.get_position()[0] <= high}
        if not axes.axison:
            unseen |= {*axes.get_xticklabels(), *axes.get_yticklabels()}
    found = [text for text in figure.findobj(Text) if text.get_text().strip() and text not in unseen]
    return [text for text in found if text.get_visible() and text.get_window_extent().width > 0.0]


def said(figure: Figure) -> list[str]:
    return [text.get_text() for text in texts(figure)]


def test_every_joint_camera_and_limb_is_named(body: BodyModel, worrying: Figure) -> None:
    found = said(worrying)
    for joint in body.joints:
        assert joint.name.replace("_", " ") in found
    for camera in body.mounts:
        assert camera.replace("_", " ") in found
    for bone in worrying_diagnosis(body).bones:
        if bone.segment.endswith(("_left", "_right")):
            assert f"{100.0 * bone.length_m:.1f} cm" in found, words(bone.segment)
    for warning in worrying_diagnosis(body).warnings:
        assert any(warning in text for text in found)


@pytest.mark.parametrize("kind", [good_diagnosis, worrying_diagnosis])
def test_no_text_is_cut_or_covers_another(body: BodyModel, kind: object) -> None:
    figure = body_figure(body, kind(body))  # type: ignore[operator]
    shown = [(text.get_text(), text.get_window_extent()) for text in texts(figure)]
    width, height = figure.get_size_inches() * figure.dpi
    for name, box in shown:
        assert box.x0 >= 0 and box.y0 >= 0 and box.x1 <= width and box.y1 <= height, f"{name!r} is cut"
    for (first, one), (second, other) in combinations(shown, 2):
        # Two lines of text stand so near that their boxes touch; letters do not.
        assert not one.padded(-1.5).overlaps(other.padded(-1.5)), f"{first!r} and {second!r} cover each other"


def test_red_is_what_a_warning_speaks_of(body: BodyModel, worrying: Figure) -> None:
    red = {text.get_text() for text in texts(worrying) if to_hex(text.get_color()) == WARNING}
    assert red == {STIFF_JOINT.replace("_", " "), "shin right", "31.0 cm", "Look at"}
    assert SHORT_THIGH == "thigh_left"
    calm = body_figure(body, good_diagnosis(body))
    assert not {text.get_text() for text in texts(calm) if to_hex(text.get_color()) == WARNING}


def test_bars_dots_and_gaps_are_those_of_the_diagnosis(body: BodyModel) -> None:
    diagnosis = good_diagnosis(body)
    figure = body_figure(body, diagnosis)
    _, _, exercise, values, gaps = figure.axes
    widths = [bar.get_width() for bar in exercise.patches]
    np.testing.assert_allclose(widths, np.degrees([joint.exercised_rad for joint in diagnosis.joints]).ravel())
    dots = [line.get_xdata() for line in values.lines if line.get_marker() == "o"]
    np.testing.assert_allclose(dots, [joint.singular_values for joint in diagnosis.joints])
    pairs = [line.get_xdata() for line in gaps.lines if line.get_marker() == "None"]
    known = [[1e3 * joint.residual_m, 1e3 * joint.refined_residual_m] for joint in diagnosis.joints]
    np.testing.assert_allclose(pairs, known)


def test_a_rig_with_many_warnings_shows_the_first_and_how_many_more(body: BodyModel) -> None:
    good = good_diagnosis(body)
    many = replace(good, cameras=tuple(replace(camera, warning=f"{camera.camera}: look") for camera in good.cameras))
    found = said(body_figure(body, many))
    assert "1.  waist_front: look" in found
    assert sum(": look" in text for text in found) == 11
    assert "and 5 more, in the tables" in found


def test_unknown_figures_and_a_body_of_other_names_are_drawn(body: BodyModel) -> None:
    good = good_diagnosis(body)
    joint = replace(
        good.joints[0], refined_residual_m=np.nan, sigma_m=np.full(3, np.nan), singular_values=np.full(3, np.nan)
    )
    strange = CalibrationDiagnosis((joint,), (), (), None, (0.0, 1.0), 0.0, 10.0, None)
    figure = body_figure(replace(body, mounts={}), strange)
    assert "spine" in said(figure)


def test_the_file_is_a_picture(body: BodyModel) -> None:
    picture = cv2.imdecode(np.frombuffer(body_png(body, good_diagnosis(body)), np.uint8), cv2.IMREAD_COLOR)
    assert picture is not None and min(picture.shape[:2]) > 1000


def test_the_same_diagnosis_gives_the_same_file(body: BodyModel) -> None:
    assert body_png(body, good_diagnosis(body)) == body_png(body, good_diagnosis(body))


@pytest.mark.parametrize("of", ["body", "legs"])
def test_both_views_show_all_of_whatever_body_it_is(of: str, request: pytest.FixtureRequest) -> None:
    """Matplotlib leaves out a label that is tied to a place beyond the ends of its axes."""
    shown: BodyModel = request.getfixturevalue(of)
    figure = body_figure(shown, good_diagnosis(shown))
    figure.canvas.draw()
    for axes in figure.axes[:2]:
        (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
        for label in (text for text in axes.texts if isinstance(text, Annotation) and text.xycoords == "data"):
            assert left <= label.xy[0] <= right and low <= label.xy[1] <= high, label
            box = label.get_window_extent()
            assert 0.0 <= box.x0 and box.x1 <= figure.bbox.width, label
        lines = np.concatenate([line.get_xydata() for line in axes.lines])
        assert left <= lines[:, 0].min() and lines[:, 0].max() <= right
        assert low <= lines[:, 1].min() and lines[:, 1].max() <= high
        box = axes.get_window_extent()
        assert (right - left) / box.width == pytest.approx((high - low) / box.height)


def test_a_last_segment_is_drawn_though_nobody_knows_how_long_it_is(body: BodyModel, legs: BodyModel) -> None:
    standing = StandingBody.of(legs)
    assert {bone.segment for bone in standing.unknown} == {"shin_left", "thigh_right"}
    assert {bone.segment for bone in (*standing.lines, *standing.unknown)} == set(legs.segments)
    assert StandingBody.of(body).unknown == []
