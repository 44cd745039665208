"""A person is placed in a real browser: by numbers; fitted, and written."""

from pathlib import Path

import numpy as np
import pytest
from helpers.shared_by_workers import made_once
from helpers.view_in_browser import BrowserView, served
from static_cameras.dressed_body import DressedBody, small_motion
from static_cameras.painted_bag import FRAMES, dressed_body, write_painted

from bodycam_ros.formats.read_captured import read_start

pytestmark = pytest.mark.long

KNEE, FOREARM = "shin_left", "forearm_right"


@pytest.fixture(scope="module")
def dressed(sample: Path) -> DressedBody:
    return dressed_body(sample)


@pytest.fixture(scope="module")
def painted(dressed: DressedBody, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return made_once(tmp_path_factory, "painted", lambda folder: write_painted(dressed, folder))


def test_a_person_is_placed_fitted_and_written(
    painted: Path, dressed: DressedBody, body_file: Path, tmp_path: Path, chromium: str
) -> None:
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

        view.wait_until(lambda: view.value("move") == "pelvis", "the pelvis is chosen")
        pelvis = place()
        view.enter("place [m]", f"{pelvis[0] + 0.3:.3f}", component=0)
        view.page.get_by_role("button", name="Undo", exact=True).wait_for()
        view.choose("move", KNEE)
        view.wait_until(lambda: abs(place()[2] - true[KNEE][2, 3]) < 0.1, "the knee of the moved body")
        assert abs(place()[0] - true[KNEE][0, 3] - 0.3) < 0.1
        view.press("Undo")
        view.wait_until(lambda: np.linalg.norm(place() - true[KNEE][:3, 3]) < 0.1, "the knee where the start has it")

        elbow = true[FOREARM][:3, 3]
        view.choose("move", FOREARM)
        view.wait_until(lambda: np.linalg.norm(place() - elbow) < 0.2, "the elbow is chosen")
        for axis in range(3):
            view.enter("place [m]", f"{elbow[axis]:.3f}", component=axis)
        view.wait_until(lambda: np.linalg.norm(place() - elbow) < 0.04, "the elbow where it was put")

        view.press("Fit")
        view.page.get_by_text("is in the images").wait_for()
        view.press("Write start.yaml")
        view.page.get_by_text("Written", exact=True).wait_for()
    assert running.errors == "bodycam: interrupted\n"
    written = read_start(output, painted / "cameras.yaml", dressed.stations, body)
    errors = [
        float(np.linalg.norm(written.world_T_segment[row, :3, 3] - true[segment][:3, 3]))
        for row, segment in enumerate(body.segments)
    ]
    assert np.mean(errors) < 0.015 and max(errors) < 0.05
