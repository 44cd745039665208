"""Curves and bands as markup: what is drawn is where the time and the angle are."""

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from bodycam_ros.drawing.picture_style import LEFT, RIGHT
from bodycam_ros.registration.camera_sight import CameraSight
from bodycam_ros.view.curve_panel import joint_groups
from bodycam_ros.view.timeline import SIGHT_COLOURS, Curve, band_rows, cursor, curve_rows


def drawn(markup: str) -> ElementTree.Element:
    return ElementTree.fromstring(f"<div>{markup}</div>")


def test_curves_of_a_row_share_one_scale_and_keep_their_peaks() -> None:
    seconds = np.linspace(0.0, 60.0, 1801)
    one, other = np.zeros(1801), np.zeros(1801)
    one[900], other[450] = 40.0, -10.0  # a single instant each
    rows = {"bends & turns": [Curve(seconds, one, LEFT), Curve(seconds, other, RIGHT, is_other=True)]}
    markup = drawn(curve_rows(rows, 60.0))
    lines = list(markup.iter("polyline"))
    assert [line.get("stroke") for line in lines] == [LEFT, RIGHT]
    assert [line.get("stroke-dasharray") is not None for line in lines] == [False, True]
    points = [np.array([pair.split(",") for pair in line.get("points", "").split()], float) for line in lines]
    assert all(len(of_line) <= 600 for of_line in points)
    peak, trough = points[0][np.argmin(points[0][:, 1])], points[1][np.argmax(points[1][:, 1])]
    assert (peak[0], trough[0]) == pytest.approx((500.0, 250.0), abs=0.1)
    zero = points[0][0, 1]
    assert zero == pytest.approx(points[1][0, 1])
    assert zero - peak[1] == pytest.approx(4.0 * (trough[1] - zero), abs=0.3)
    assert "-10 to 40" in "".join(markup.itertext()) and "bends & turns" in "".join(markup.itertext())


def test_bands_show_the_worst_of_each_moment_and_gaps() -> None:
    seconds = np.arange(0.0, 10.0, 0.1)
    sights = np.full(100, CameraSight.REGISTERED, np.int8)
    sights[40:60] = CameraSight.BLIND
    gap = (seconds < 8.0) | (seconds >= 9.0)
    markup = drawn(band_rows({"shin_left": (seconds[gap], sights[gap])}, 9.9))
    parts = [part.get("style", "") for part in markup.iter("div") if "position:absolute" in part.get("style", "")]
    numbers = [[float(x) for x in re.findall(r"(?:left|width):([\d.]+)%", style)] for style in parts]
    blind = [n for n, style in zip(numbers, parts, strict=True) if SIGHT_COLOURS[CameraSight.BLIND] in style]
    assert blind == [pytest.approx([40.0, 20.0], abs=0.7)]
    covered = sum(width for _, width in numbers)
    assert covered == pytest.approx(90.0, abs=1.0)  # nothing where there is no image
    text = "".join(markup.itertext())
    assert "shin left" in text and "registered" in text and "blind" in text and "relative" not in text


def test_the_cursor_is_where_the_time_is() -> None:
    assert "* 0.2500" in cursor(0.25, 100) and "height:100px" in cursor(0.25, 100)


def test_joints_of_both_sides_share_their_rows() -> None:
    names = ("neck_y", "knee_left_y", "knee_left_x", "knee_right_y", "knee_right_x", "crank", "bicycle_at_x")
    groups = joint_groups(names)
    assert groups["knee"] == {
        "bends (y)": ["knee_left_y", "knee_right_y"],
        "sideways (x)": ["knee_left_x", "knee_right_x"],
    }
    assert groups["neck"] == {"bends (y)": ["neck_y"]} and groups["crank"] == {"bends": ["crank"]}
    assert list(groups) == ["neck", "knee", "crank"]
