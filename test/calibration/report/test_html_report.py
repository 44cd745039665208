import base64
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest
from helpers.known_calibration import calibrated_body, good_diagnosis, worrying_diagnosis

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.calibration.diagnosis import CalibrationDiagnosis
from bodycam_ros.evaluate.body_report import _BONES_NOTE, _CAMERAS_NOTE, _JOINTS_NOTE, body_png, html_report

VOID = {"meta", "img"}


class Page(HTMLParser):
    """Reads a page, and refuses one whose tags do not close in the order in which they opened."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.open: list[str] = []
        self.tags: list[str] = []
        self.attributes: list[tuple[str, str]] = []
        self.rows: list[list[str]] = []
        self.text = ""
        self.feed(text)
        self.close()
        assert self.open == []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.tags.append(tag)
        self.attributes += [(name, value or "") for name, value in attrs]
        if tag == "tr":
            self.rows.append([])
        if tag in ("td", "th"):
            self.rows[-1].append("")
        if tag not in VOID:
            self.open.append(tag)

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.text += data
        if self.open and self.open[-1] in ("td", "th"):
            self.rows[-1][-1] += data


@pytest.fixture(scope="module")
def body() -> BodyModel:
    return calibrated_body()


@pytest.fixture(scope="module")
def diagnosis(body: BodyModel) -> CalibrationDiagnosis:
    return worrying_diagnosis(body)


def test_the_picture_is_inside_and_nothing_is_fetched_or_run(body: BodyModel, diagnosis: CalibrationDiagnosis) -> None:
    text = html_report(body, diagnosis)
    page = Page(text)
    (source,) = [value for name, value in page.attributes if name == "src"]
    assert base64.b64decode(source.removeprefix("data:image/png;base64,")) == body_png(body, diagnosis)
    assert not {"script", "link", "iframe"} & set(page.tags)
    assert not any(name.startswith("on") for name, _ in page.attributes)
    links = [value.removeprefix("#") for name, value in page.attributes if name == "href"]
    assert links and links == [value for name, value in page.attributes if name == "id"], "contents, of the page alone"
    assert "://" not in text and "url(" not in text
    assert text.index("Content-Security-Policy") < text.index("<style"), "from the first element on"


def test_names_are_taken_as_text(body: BodyModel, diagnosis: CalibrationDiagnosis) -> None:
    nasty = '<script>alert("&")</script>'
    joints = (replace(diagnosis.joints[0], name=nasty, advice=f"{nasty}: look"), *diagnosis.joints[1:])
    page = Page(html_report(replace(body, name=nasty), replace(diagnosis, joints=joints)))
    assert "script" not in page.tags
    assert nasty in [row[0] for row in page.rows]
    assert f"{nasty}: look" in page.text and f"Body {nasty}" in page.text


def test_unknown_figures_and_a_body_without_cameras_are_drawn(body: BodyModel) -> None:
    unknown = np.full(3, np.nan)
    joint = good_diagnosis(body).joints[0]
    joint = replace(joint, gap_m=np.nan, sigma_m=unknown)
    strange = CalibrationDiagnosis((joint,), (), (), (0.0, 1.0), 0.0, 10.0, None)
    assert joint.name in [row[0] for row in Page(html_report(replace(body, mounts={}), strange)).rows]


def test_a_note_explains_the_columns_that_are_there_and_no_other(body: BodyModel) -> None:
    good = good_diagnosis(body)
    cameras = tuple(replace(camera, readout=None, clock_s=None, moved_m=0.0) for camera in good.cameras)
    without = Page(html_report(body, replace(good, cameras=cameras)))
    headings = {cell.split(" [")[0] for row in without.rows for cell in row}
    notes = {*_JOINTS_NOTE.items(), *_BONES_NOTE.items(), *_CAMERAS_NOTE.items()}
    explained = {name for name, note in notes if f"{name}: {note}" in without.text}
    assert explained == {name for name, _ in notes if name in headings}
    assert "gap" in explained and not {"read-out", "clock"} & explained


def test_the_picture_explains_red_only_where_something_is_red(body: BodyModel, diagnosis: CalibrationDiagnosis) -> None:
    good = good_diagnosis(body)
    assert not good.warnings and diagnosis.warnings
    assert "red: see the warnings" not in Page(html_report(body, good)).text
    assert "red: see the warnings" in Page(html_report(body, diagnosis)).text
