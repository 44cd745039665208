"""The solver's session without ROS: states, another map, a flush, a reset."""

from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from helpers.steady_motion import FRAME_NS, SPEED, START_NS, registrations
from helpers.two_cameras import write_body

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.diagnostics import solver_diagnostics
from bodycam_ros.diagnostics.dropped_messages import DroppedMessages
from bodycam_ros.errors import BodyError, StaticCameraError
from bodycam_ros.geometry import exp_se3
from bodycam_ros.graph.node_parameters import SolverParameters
from bodycam_ros.graph.solver_session import SolverOutputs, SolverSession
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.results.verdict import Level

HALL, CELLAR = "9f86d081884c7d65", "60303ae22b998861"


class Solved:
    """A session of a body, and what it has put out."""

    def __init__(self, body: Path, **given: object) -> None:
        self.states: list[BodyOutput] = []
        self.restarts: list[BodyModel] = []
        self.warnings: list[str] = []
        outputs = SolverOutputs(
            body=lambda body, equipment: None,
            restarted=self.restarts.append,
            state=lambda output, body: self.states.append(output),
            measured=lambda stamps_ns, measured: None,
        )
        parameters = SolverParameters(body=str(body), **given)  # type: ignore[arg-type]
        self.session = SolverSession(parameters, PipelineSettings(), outputs, DroppedMessages(self.warnings.append))
        self.session.start()

    def add(self, frames: range, **map_of: str) -> None:
        """Registrations of all cameras, each in the map that is given for it, or in HALL."""
        body = self.session.body
        assert body is not None
        for matches in registrations(body, frames):
            self.session.add_registration(replace(matches, map_identity=map_of.get(matches.camera, HALL)))

    @property
    def frames(self) -> list[int]:
        return [(output.state.stamp_ns - START_NS) // FRAME_NS for output in self.states]


def test_states_come_and_the_rest_by_a_flush(tmp_path: Path) -> None:
    solved = Solved(write_body(tmp_path / "body.yaml"))
    solved.add(range(60))  # the first second waits until clocks are known
    assert solved.frames == list(range(56)) and len(solved.restarts) == 1
    assert solved.session.flush() == 4 and solved.frames == list(range(60))
    assert solved.session.flush() == 0
    along_x = [output.state.world_T_segment[0, 0, 3] for output in solved.states]
    np.testing.assert_allclose(along_x, SPEED * 1e-9 * FRAME_NS * np.arange(60), atol=2e-3)
    assert "restarts" in solved.session.reset() and len(solved.restarts) == 2


def test_a_camera_in_another_map_is_left_out_and_the_verdict_is_wrong(tmp_path: Path) -> None:
    solved = Solved(write_body(tmp_path / "body.yaml", "odd"))
    solved.add(range(10))
    solved.add(range(10, 40), odd=CELLAR)
    solved.session.flush()
    assert solved.states[-1].state.cameras_used == 2, "the other two"
    verdict = solved.session.verdict()
    assert verdict is not None and verdict.level is Level.WRONG
    (finding,) = [finding for finding in verdict.findings if finding.check == "map"]
    assert finding.subject == "odd" and HALL in finding.what and CELLAR in finding.what
    assert any(HALL in warning and CELLAR in warning for warning in solved.warnings)
    solved.add(range(40, 50))
    verdict = solved.session.verdict()
    assert verdict is not None and not [finding for finding in verdict.findings if finding.check == "map"]


def test_the_body_restarts_in_the_map_of_most_cameras(tmp_path: Path) -> None:
    solved = Solved(write_body(tmp_path / "body.yaml", "odd"))
    solved.add(range(10))
    solved.add(range(10, 40), odd=CELLAR, left=CELLAR)
    assert len(solved.restarts) == 2 and any("most cameras" in warning for warning in solved.warnings)
    solved.session.flush()
    assert solved.states[-1].state.cameras_used == 2


@pytest.mark.parametrize("takes_images", [True, False])
def test_a_backlog_is_not_called_a_clock(tmp_path: Path, takes_images: bool) -> None:
    """Registrations of the past, of a camera whose images are of now or of then."""
    solved = Solved(write_body(tmp_path / "body.yaml", "odd"))
    solved.add(range(40))
    body = solved.session.body
    assert body is not None
    for matches in registrations(body, range(40, 70)):
        late_ns = 9_700_000_000 if matches.camera == "odd" else 0
        if takes_images:
            solved.session.add_image(matches.camera, matches.stamp_ns)
        solved.session.add_registration(replace(matches, stamp_ns=matches.stamp_ns - late_ns))
    status = next(each for each in solved.session.report() if each.name == "camera odd")
    assert ("does not keep up" if takes_images else "its stamps are 9.7 s behind") in status.text, status.text


def test_cameras_that_are_registered_are_not_said_to_be_lost(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Three cameras contradict each other from the start, so that no state is solved."""
    solved = Solved(write_body(tmp_path / "body.yaml", "odd"))
    body, now_s = solved.session.body, [0.0]
    assert body is not None
    monkeypatch.setattr(solver_diagnostics, "time", SimpleNamespace(monotonic=lambda: 1000.0 + now_s[0]))
    for matches in registrations(body, range(120)):
        now_s[0] = 1e-9 * (matches.stamp_ns - START_NS)
        away = np.array([0.0, 0.0, 0.0, 4.0 * list(body.mounts).index(matches.camera), 0.0, 0.0])
        assert matches.world_T_camera is not None
        solved.session.add_registration(replace(matches, world_T_camera=matches.world_T_camera @ exp_se3(away)))
    assert not solved.states
    status = solved.session.report()[0]
    assert status.level == 2 and "left, odd, right can be used, but they contradict each other" in status.text


def test_wrong_parameters_are_refused(tmp_path: Path) -> None:
    body = write_body(tmp_path / "body.yaml")
    with pytest.raises(BodyError, match="nobody"):
        Solved(body, cameras=("nobody",))
    with pytest.raises(StaticCameraError, match="start"):
        Solved(body, start="start.yaml")
