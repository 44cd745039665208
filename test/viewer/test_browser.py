"""The view in a real browser: what a person sees, does and writes."""

import colorsys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from helpers.view_in_browser import WINDOW, BrowserView, served
from numpy.typing import NDArray

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.stick_figure import body_bones
from bodycam_ros.results.colours import rgb, side_colour
from bodycam_ros.viewer.correction import Correction, Part, place_of
from bodycam_ros.viewer.editor import SIZE_M
from bodycam_ros.viewer.motion import Motion, read_motion
from bodycam_ros.viewer.scene import REGISTERED, SELECTED, TOUCHING
from bodycam_ros.viewer.viewpoint import FIELD_OF_VIEW, OpeningView, points_to_see

pytestmark = pytest.mark.long

KNEE = Part("joint", "knee_left")
_HUE, _GREY = 0.05, 0.35  # a lit surface keeps the hue of its colour; what is less saturated is grey
_SEEN = 0.7  # share of a limb that nothing else hides


@pytest.fixture(scope="module")
def body(sample: Path) -> BodyModel:
    return read_body(sample / "body.yaml")


@pytest.fixture(scope="module")
def motion(sample_out: Path, body: BodyModel) -> Motion:
    return read_motion(sample_out, body)


@pytest.fixture
def view(sample: Path, sample_out: Path, body_file: Path, chromium: str) -> Iterator[BrowserView]:
    given = [sample_out, "--map", sample / "map", "--body", body_file, "--recording", sample / "sample" / "bag"]
    with served(*given) as running, BrowserView.opened(running.address, chromium) as opened:
        yield opened


class Expected:
    """Where the window should show what, by a pinhole camera of our own."""

    def __init__(self, view: BrowserView, motion: Motion, body: BodyModel) -> None:
        self.motion = motion
        self.left, self.top, self.width, self.height = view.canvas()
        root = motion.world_T_root[0]
        points = points_to_see(body, motion.segments_at(body, 0))
        opening = OpeningView.of_body(root, points - root[:3, 3] * [1, 1, 0])
        forward = opening.look_at - opening.position
        forward /= np.linalg.norm(forward)
        right = np.cross(forward, [0.0, 0.0, 1.0])
        right /= np.linalg.norm(right)
        self.position, self.axes = opening.position, np.stack([right, np.cross(forward, right), forward])

    def pixels(self, points_world: NDArray[np.float64], instant: int) -> NDArray[np.float64]:
        """Columns and rows (N, 2) of points (N, 3) while the view follows the body."""
        followed = self.motion.world_T_root[instant, :3, 3] * [1, 1, 0]
        x, y, z = self.axes @ (points_world - followed - self.position).T
        focal = self.height / 2.0 / np.tan(FIELD_OF_VIEW / 2.0)
        middle = np.array([self.left + self.width / 2.0, self.top + self.height / 2.0])
        return np.stack([x, y], axis=1) * (focal / z)[:, None] + middle

    def limbs(self, body: BodyModel, side: str, instant: int) -> NDArray[np.float64]:
        """Places along the middle of all limbs of a side."""
        along = np.linspace(0.2, 0.8, 13)[:, None]
        limbs = [
            limb for limb in body_bones(body, self.motion.segments_at(body, instant)) if limb.segment.endswith(side)
        ]
        points = np.concatenate([(1.0 - along) * limb.start + along * limb.end for limb in limbs])
        return self.pixels(points, instant)


def share(picture: NDArray[np.uint8], places: NDArray[np.float64], colour: tuple[int, int, int]) -> float:
    """Share of places (N, 2) in a picture that have a colour's hue."""
    hue = colorsys.rgb_to_hsv(*(np.array(colour) / 255.0))[0]
    columns, rows = np.round(places).astype(int).T
    seen = [colorsys.rgb_to_hsv(*(pixel / 255.0)) for pixel in picture[rows, columns]]
    return float(np.mean([s > _GREY and abs((h - hue + 0.5) % 1.0 - 0.5) < _HUE for h, s, _ in seen]))


LEFT, RIGHT = rgb(side_colour("shin_left")), rgb(side_colour("shin_right"))


def test_a_person_sees_the_body_where_it_is(view: BrowserView, motion: Motion, body: BodyModel) -> None:
    expected = Expected(view, motion, body)
    view.page.get_by_role("checkbox", name="cameras").uncheck()  # they hide parts of the limbs

    def shows(instant: int) -> bool:
        picture = view.picture()
        left, right = (expected.limbs(body, side, instant) for side in ("_left", "_right"))
        assert share(picture, left, RIGHT) < 0.2 and share(picture, right, LEFT) < 0.2
        return share(picture, left, LEFT) > _SEEN and share(picture, right, RIGHT) > _SEEN

    view.wait_until(lambda: shows(0), "both sides of the body in their colours")
    rows = np.concatenate([expected.limbs(body, side, 0) for side in ("_left", "_right")])[:, 1]
    assert np.ptp(rows) > 0.5 * view.canvas()[3]  # the body fills the window

    later = motion.state_at(1.0)
    assert not shows(later)
    view.enter("seconds", "1")
    view.wait_until(lambda: shows(later), "the body where it is a second later")

    view.press("Play")
    view.wait_until(lambda: view.value("seconds") != "1", "time goes on")
    view.press("Pause")

    keys_play_and_step_and_leave_the_view_where_it_is(view, motion, expected, body)


def keys_play_and_step_and_leave_the_view_where_it_is(
    view: BrowserView, motion: Motion, expected: Expected, body: BodyModel
) -> None:
    press = view.page.keyboard.press

    def at(instant: int) -> None:
        view.wait_until(lambda: view.value("seconds") == f"{round(motion.seconds[instant], 3):g}", f"instant {instant}")

    press("Home")
    at(0)
    for instant in (1, 2):  # one after the other: of presses within some milliseconds the page may tell one
        press("ArrowRight")
        at(instant)
    press("Shift+ArrowRight")
    at(17)
    press("ArrowLeft")
    at(16)
    places = np.concatenate([expected.limbs(body, side, 16) for side in ("_left",)])
    view.wait_until(lambda: share(view.picture(), places, LEFT) > _SEEN, "the body, seen from where it was")
    press("End")
    at(len(motion.stamps_ns) - 1)
    press("Space")
    view.page.get_by_role("button", name="Pause").wait_for()
    press("Space")
    view.page.get_by_role("button", name="Play").wait_for()
    press("Home")
    at(0)


def test_cameras_show_that_they_are_registered_and_what_they_saw(
    view: BrowserView, motion: Motion, body: BodyModel
) -> None:
    assert all(motion.registered_at(camera, 0) is not None for camera in body.mounts)
    left, top, width, height = view.canvas()
    columns, rows = np.meshgrid(np.arange(left, left + width, 3), np.arange(top, top + height, 3))
    everywhere = np.stack([columns.ravel(), rows.ravel()], axis=1)

    def registered() -> float:
        return share(view.picture(), everywhere, rgb(REGISTERED))

    view.choose("camera", "shin_left")
    view.page.get_by_text("px off (median)").wait_for()
    image = view.page.locator("img:visible").last
    assert image.evaluate("i => [i.naturalWidth, i.naturalHeight]") == [640, 480]
    view.wait_until(lambda: registered() > 0.005, "pyramids in the colour of registered cameras")
    shown = registered()
    view.page.get_by_role("checkbox", name="cameras").uncheck()
    view.wait_until(lambda: registered() < shown / 5.0, "no cameras")


def test_a_joint_is_moved_by_numbers_and_by_hand_and_written(
    view: BrowserView, motion: Motion, body: BodyModel, body_file: Path
) -> None:
    expected = Expected(view, motion, body)
    before = body_file.read_bytes()
    segment = body.segment_index[place_of(body, KNEE)[0]]
    world_T_thigh = motion.segments_at(body, 0)[segment]

    def knee(corrected: BodyModel) -> NDArray[np.float64]:
        return expected.pixels((world_T_thigh @ place_of(corrected, KNEE)[1][:, 3])[None, :3], 0) + np.array([[5, -5]])

    view.wait_until(lambda: share(view.picture(), knee(body), LEFT) == 1.0, "the knee in the colour of its side")
    view.click(knee(body)[0])
    view.wait_until(lambda: view.value("move") == str(KNEE), "the knee that was clicked is selected")
    pose = place_of(body, KNEE)[1].copy()
    x, y, z = (f"{at:.4f}" for at in pose[:3, 3])
    view.wait_until(lambda: float(view.value("place [m]", 2)) == float(z), "where the knee is")
    pose[2, 3] = float(z) + 0.08
    moved = Correction(body, body).moved_to(KNEE, pose).body
    view.enter("place [m]", f"{pose[2, 3]:.4f}", component=2)
    view.page.get_by_text("joint knee_left: 80.0 mm, 0.00 deg").wait_for()
    view.wait_until(lambda: share(view.picture(), knee(moved), rgb(SELECTED)) == 1.0, "the knee where it was moved to")
    view.press("Undo")
    view.wait_until(lambda: float(view.value("place [m]", 2)) == float(z), "nothing moved")
    view.wait_until(lambda: share(view.picture(), knee(body), rgb(SELECTED)) == 1.0, "the knee where it was")

    leftwards = np.array([0.0, 1.0, 0.0])
    at_m = [share * SIZE_M * leftwards for share in (0.55, 0.9)]
    grip, target = (
        expected.pixels(
            (world_T_thigh[:3, :3] @ (place_of(body, KNEE)[1][:3, 3] + at) + world_T_thigh[:3, 3])[None], 0
        )[0]
        for at in at_m
    )
    view.drag(grip, target)
    view.wait_until(lambda: float(view.value("place [m]", 1)) > float(y) + 0.03, "the knee is further left")
    assert [float(view.value("place [m]", component)) for component in (0, 2)] == [float(x), float(z)]

    view.press("Write body.yaml")
    view.page.get_by_text("Written", exact=True).wait_for()
    written = read_body(body_file)
    (note,) = written.report["corrections"]
    shift_mm = (place_of(written, KNEE)[1] - place_of(body, KNEE)[1])[:3, 3] * 1e3
    assert note["joint"] == "knee_left" and note["moved_mm"] == pytest.approx(shift_mm, abs=2e-3)
    assert shift_mm[1] == pytest.approx(0.35 * SIZE_M * 1e3, abs=15.0)
    assert body_file.with_name("body.yaml.orig").read_bytes() == before
    view.page.get_by_text("not written yet").wait_for(state="hidden")


def test_without_a_bag_the_body_stands_and_what_is_not_written_is_said(
    sample: Path, body: BodyModel, body_file: Path, chromium: str
) -> None:
    before = body_file.read_bytes()
    standing = Motion.standing(body)
    with (
        served("--map", sample / "map", "--body", body_file) as running,
        BrowserView.opened(running.address, chromium) as view,
    ):
        view.page.get_by_role("checkbox", name="cameras").uncheck()
        left = Expected(view, standing, body).limbs(body, "_left", 0)
        view.wait_until(lambda: share(view.picture(), left, LEFT) > _SEEN, "the left side of the N-pose")
        view.choose("move", "camera head")
        view.enter("place [m]", f"{place_of(body, Part('camera', 'head'))[1][2, 3] + 0.02:.4f}", component=2)
        view.page.get_by_text("camera head: 20.0 mm, 0.00 deg").wait_for()
    assert running.errors == f"bodycam: not written to {body_file}: camera head\nbodycam: interrupted\n"
    assert body_file.read_bytes() == before


def test_the_timeline_takes_the_whole_width_and_covers_nothing(view: BrowserView) -> None:
    panel = view.page.locator("[data-floating-window]:has(.bodycam-timeline)")
    box = panel.bounding_box()
    assert box is not None
    assert (box["x"], box["width"], box["y"] + box["height"]) == (0.0, WINDOW[0], WINDOW[1])
    _, top, _, height = view.canvas()
    assert top + height <= box["y"]
    track, rows = (
        panel.locator(each).first.bounding_box() for each in (".mantine-Slider-track", "svg[viewBox='0 0 1 1']")
    )
    assert track is not None and rows is not None
    ends = [(each["x"], each["x"] + each["width"]) for each in (track, rows)]
    assert np.allclose(*ends, atol=4.0), "a span is beneath the slider's place at its time"

    view.page.set_viewport_size({"width": 1000, "height": 600})
    view.wait_until(lambda: (panel.bounding_box() or {})["width"] == 1000, "as wide as the smaller window")


def test_a_trail_and_contacts_are_drawn_and_hidden(view: BrowserView) -> None:
    left, top, width, height = view.canvas()
    columns, rows = np.meshgrid(np.arange(left, left + width, 2), np.arange(top, top + height, 2))
    everywhere = np.stack([columns.ravel(), rows.ravel()], axis=1)

    def pixels(colour: tuple[int, int, int]) -> float:
        return share(view.picture(), everywhere, colour) * len(everywhere)

    layer = view.page.get_by_role("checkbox", name="contacts")
    view.enter("seconds", "0.1")
    layer.uncheck()
    view.page.wait_for_timeout(2000)
    none = pixels(rgb(TOUCHING))  # landmarks may be green, too
    layer.check()
    view.wait_until(lambda: pixels(rgb(TOUCHING)) > none + 30, "feet at rest are marked")
    layer.uncheck()
    view.wait_until(lambda: pixels(rgb(TOUCHING)) < none + 15, "no marks")
    before = pixels(RIGHT)
    view.choose("trail of", "ankle_right")
    view.wait_until(lambda: pixels(RIGHT) > before + 15, "the way of the joint")
