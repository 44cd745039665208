from dataclasses import replace

import numpy as np
import pytest
from known_calibration import calibrated_body, good_diagnosis, words, worrying_diagnosis
from matplotlib.figure import Figure
from matplotlib.text import Text

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.calibration.report.body_picture import body_figure


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return calibrated_body()


@pytest.fixture(scope="module")
def worrying(body: BodyModel) -> Figure:
    return body_figure(body, worrying_diagnosis(body))


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


def test_unknown_figures_and_a_body_of_other_names_are_drawn(body: BodyModel) -> None:
    good = good_diagnosis(body)
    joint = replace(
        good.joints[0], refined_residual_m=np.nan, sigma_m=np.full(3, np.nan), singular_values=np.full(3, np.nan)
    )
    strange = CalibrationDiagnosis((joint,), (), (), None, (0.0, 1.0), 0.0, 10.0, None)
    figure = body_figure(replace(body, mounts={}), strange)
    assert "spine" in said(figure)
