"""Fixtures that several tests share."""

import os
import signal
from pathlib import Path

import cv2
import pytest
from helpers.known_ride import make_ride
from helpers.known_walk import Walk, make_walk
from helpers.rider import rider_body
from helpers.shared_by_workers import made_once
from helpers.tiny_bag import write_tiny_bag
from threadpoolctl import threadpool_limits

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import KernelError
from bodycam_ros.files.bounded_inputs import bound_inputs
from bodycam_ros.kernels import load_kernels
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.replaying.replay import replay
from bodycam_ros.replaying.replay_request import ReplayRequest

REPOSITORY = Path(__file__).parent.parent


def pytest_configure() -> None:
    """Let signals reach the tests of them, and let workers that test side by side not get in each other's way."""
    _refuse_old_kernels()
    # What a shell started in the background ignores Ctrl-C, what nohup started a closed terminal; so do their children.
    bound_inputs()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    signal.signal(signal.SIGHUP, signal.SIG_DFL)
    # Small matrices: threads cost more than they bring, most of all where every core has a worker already.
    threadpool_limits(1)
    cv2.setNumThreads(1)


def _refuse_old_kernels() -> None:
    """End where a kernel was changed and not compiled: tests would pass or fail by the old one."""
    try:
        compiled_s = Path(str(load_kernels().__file__)).stat().st_mtime
    except KernelError as error:
        pytest.exit(str(error), returncode=4)
    changed = [file for file in (REPOSITORY / "bodycam_ros").rglob("*_kernels.py") if file.stat().st_mtime > compiled_s]
    if changed:
        pytest.exit(f"{', '.join(map(str, changed))}: changed, and not compiled; run `make kernels`", returncode=4)


@pytest.fixture(scope="session")
def sample() -> Path:
    """The sample that the repository carries: recording, map and body."""
    return REPOSITORY / "bags"


@pytest.fixture(scope="session")
def shared() -> Path:
    """Recordings with ground truth, which lie beside the repository where it is developed."""
    path = REPOSITORY.parent / "shared" / "recordings"
    if not path.is_dir():
        pytest.skip("the recordings with ground truth (../shared/recordings) are not on this machine")
    return path


@pytest.fixture
def tiny_bag(tmp_path: Path) -> Path:
    """A bag of two cameras, ``left`` and ``right``, with four frames each."""
    return write_tiny_bag(tmp_path / "tiny")


@pytest.fixture(scope="session")
def sample_out(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample, replayed once for all tests of all workers."""
    bag, jobs = sample / "sample" / "bag", os.cpu_count() or 1

    def make(folder: Path) -> None:
        replay(ReplayRequest(bag, sample / "map", sample / "body.yaml", folder / "out", PipelineSettings(), jobs))

    return made_once(tmp_path_factory, "sample", make) / "out"


@pytest.fixture
def rider() -> BodyModel:
    """Joint frames turned and shifted on both sides, a sensor welded to the shin, and a foot on a pedal: a loop."""
    return rider_body()


@pytest.fixture(scope="session")
def walk() -> Walk:
    """A body that walks in a way that is known exactly."""
    return make_walk()


@pytest.fixture(scope="session")
def ride() -> Walk:
    """The same body on a bicycle, whose crank it turns."""
    return make_ride()
