"""A person is placed in a real browser: by numbers, by clicks in images, by a drag; fitted, and written."""

import time
from pathlib import Path

import numpy as np
import pytest
from made_once import made_once
from static_cameras.dressed_body import DressedBody, small_motion
from static_cameras.painted_bag import FRAMES, dressed_body, write_painted

from bodycam_ros.geometry import inverse, transform_points
from bodycam_ros.static_cameras.start_file import read_start
from bodycam_ros.viewer.gizmo import SIZE_M

pytest.importorskip("playwright", reason="playwright is not installed: make test installs it")
from view_in_browser import BrowserView, find_chromium, served  # noqa: E402

pytestmark = pytest.mark.long

KNEE, FOREARM = "shin_left", "forearm_right"


@pytest.fixture(scope="module")
def dressed(sample: Path) -> DressedBody:
    return dressed_body(sample)


@pytest.fixture(scope="module")
def painted(dressed: DressedBody, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_once(tmp_path_factory, "painted", lambda folder: write_painted(dressed, folder))


def seen_from(view: BrowserView, dressed: DressedBody, camera: str, root: np.ndarray, point: np.ndarray) -> np.ndarray:
    """Where the window (2,) has a point while it is looked at from a camera, close up, the root in the middle."""
    station = dressed.stations[camera]
    eye = station.world_T_camera[:3, 3]
    ahead = (root - eye) / np.linalg.norm(root - eye)
    right = np.cross(ahead, -station.world_T_camera[:3, 1])
    right /= np.linalg.norm(right)
    x, y, z = np.stack([right, np.cross(ahead, right), ahead]) @ (point - eye)
    left, top, width, height = view.canvas()
    focal = height / 2.0 / (1.2 / np.linalg.norm(root - eye))
    return np.array([left + width / 2.0 + focal * x / z, top + height / 2.0 + focal * y / z])


def test_a_person_is_placed_fitted_and_written(
    painted: Path, dressed: DressedBody, body_file: Path, tmp_path: Path
) -> None:
    chromium = find_chromium()
    if chromium is None:
        pytest.skip("there is no Chromium on this machine: apt-get install chromium")
    body, output = dressed.body, tmp_path / "start.yaml"
    true = dict(zip(body.segments, small_motion(body, FRAMES)[0], strict=True))
    given = ["--place", painted / "bag", "--stations", painted / "cameras.yaml", "--body", body_file]
    given += ["--start", painted / "start.yaml", "-o", output]
    with (
        served(*given) as running,
        BrowserView.opened(running.address, chromium, (1600, 900), shows="Fit") as view,
    ):

        def place() -> np.ndarray:
            return np.array([float(view.value("place [m]", axis)) for axis in range(3)])

        view.wait_until(lambda: view.value("segment") == "pelvis", "the pelvis is chosen")
        pelvis = place()
        view.enter("place [m]", f"{pelvis[0] + 0.3:.3f}", component=0)
        view.page.get_by_role("button", name="Undo", exact=True).wait_for()
        view.choose("segment", KNEE)
        view.wait_until(lambda: abs(place()[2] - true[KNEE][2, 3]) < 0.1, "the knee of the moved body")
        assert abs(place()[0] - true[KNEE][0, 3] - 0.3) < 0.1
        view.press("Undo")
        view.wait_until(lambda: np.linalg.norm(place() - true[KNEE][:3, 3]) < 0.1, "the knee where the start has it")

        elbow = true[FOREARM][:3, 3]
        view.choose("segment", FOREARM)
        view.page.get_by_role("checkbox", name="close up").check()
        for camera in ("ext_00", "ext_01"):
            view.choose("from", camera)
            time.sleep(2.0)
            view.page.keyboard.down("Shift")
            view.click(seen_from(view, dressed, camera, pelvis, elbow))
            view.page.keyboard.up("Shift")
            camera_T_world = inverse(dressed.stations[camera].world_T_camera)

            def off_px(camera: str = camera, camera_T_world: np.ndarray = camera_T_world) -> float:
                points = transform_points(camera_T_world, np.stack([place(), elbow]))
                return float(np.linalg.norm(np.diff(dressed.stations[camera].camera.project(points)[0], axis=0)))

            view.wait_until(lambda: off_px() < 6.0, f"the elbow where it was clicked in {camera}")
        clicked = place()
        assert np.linalg.norm(clicked - elbow) < 0.04

        arrow = np.outer([0.55, 0.9], SIZE_M * true[FOREARM][:3, 0])
        view.drag(*(seen_from(view, dressed, camera, pelvis, clicked + along) for along in arrow))
        view.wait_until(lambda: np.linalg.norm(place() - clicked) > 0.03, "the elbow where it was dragged")
        view.press("Undo")
        view.wait_until(lambda: np.array_equal(place(), clicked), "a drag is one step")

        view.press("Fit")
        view.page.get_by_text("is in the images").wait_for()
        view.press("Write start.yaml")
        view.page.get_by_text("Written", exact=True).wait_for()
    assert running.said == "bodycam: interrupted\n"
    written = read_start(output, body)
    errors = [float(np.linalg.norm(written[segment][:3, 3] - true[segment][:3, 3])) for segment in body.segments]
    assert np.mean(errors) < 0.015 and max(errors) < 0.05
