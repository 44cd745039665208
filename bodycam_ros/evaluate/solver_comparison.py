"""Registrations of a recording solved in every way, as they are and with cameras dark in turn."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import MapError
from bodycam_ros.evaluate.solver_errors import SolverErrors, solver_errors
from bodycam_ros.evaluate.solver_runs import SolverRun, Way, body_frames, dark_in_turn, run_solver
from bodycam_ros.evaluate.true_motion import TrueMotion
from bodycam_ros.kernels.preparation import load_kernels, prepare_kernels
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.replay.camera_worker import RegisteredImage, RegistrationTask
from bodycam_ros.replay.front_end import register_recording, warm_up


@dataclass(frozen=True, eq=False)
class MeasuredRun:
    """A run, and its errors where the truth is known."""

    run: SolverRun
    errors: SolverErrors | None


@dataclass(frozen=True, eq=False)
class SolverComparison:
    """Way -> what came of it: of the registrations as they are, and with cameras dark in turn."""

    as_recorded: Mapping[Way, MeasuredRun]
    dark: Mapping[Way, MeasuredRun]


def registrations(
    recording_path: Path, map_path: Path, cameras: Mapping[str, CameraModel], settings: PipelineSettings, jobs: int
) -> list[LandmarkMatches]:
    """What the cameras of a recording say, in order of time.

    Raises:
        BodycamError: see ``register_recording``.
        MapError: no camera finds itself in the map.
    """
    warm_up()
    task = RegistrationTask(recording_path, map_path, settings)
    images = register_recording(task, cameras, jobs)
    said = [image.matches for image in images if isinstance(image, RegisteredImage)]
    if not any(matches.world_T_camera is not None for matches in said):
        raise MapError(f"no camera of {recording_path} could be registered in {map_path}: there is nothing to solve")
    return said


def compare_solvers(
    body: BodyModel,
    cameras: Mapping[str, CameraModel],
    registered: Sequence[LandmarkMatches],
    settings: PipelineSettings,
    truth: TrueMotion | None,
    on_instant: Callable[[str], None] = lambda what: None,
) -> SolverComparison:
    """Solve registrations in every way.

    Args:
        body: with its mounts.
        cameras: models by name.
        registered: what the cameras said, in order of time.
        settings: of all stages; the way decides how instants are solved.
        truth: to measure errors by, if it is known.
        on_instant: told after each instant what it was solved for.

    Raises:
        RecordingError: the truth is of another recording or body.
    """
    prepare_kernels()
    load_kernels()

    def measured(said: Sequence[LandmarkMatches], light: str) -> dict[Way, MeasuredRun]:
        frames = body_frames(body, cameras, said, settings)
        runs = {}
        for way in Way:
            run = run_solver(way, body, cameras, frames, settings, partial(on_instant, f"{way.value}, {light}"))
            runs[way] = MeasuredRun(run, None if truth is None else solver_errors(run, body, truth))
        return runs

    return SolverComparison(measured(registered, "as recorded"), measured(dark_in_turn(registered), "cameras dark"))
