"""Fixtures that several tests share."""

import os
import signal
from pathlib import Path

import pytest
from known_walk import Walk, make_walk
from rider import rider_body
from tiny_bag import write_tiny_bag

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.pipeline import PipelineSettings
from bodycam_ros.replay.replay import replay

REPOSITORY = Path(__file__).parent.parent


def pytest_configure() -> None:
    """Let Ctrl-C reach the tests of it: what a shell started in the background ignores it, and so do its children."""
    signal.signal(signal.SIGINT, signal.default_int_handler)


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
    """The sample, replayed once for all tests."""
    out = tmp_path_factory.mktemp("sample") / "out"
    bag, jobs = sample / "sample" / "bag", os.cpu_count() or 1
    replay(bag, sample / "map", sample / "body.yaml", out, PipelineSettings(), jobs)
    return out


@pytest.fixture
def rider() -> BodyModel:
    """Joint frames turned and shifted on both sides, a sensor welded to the shin, and a foot on a pedal: a loop."""
    return rider_body()


@pytest.fixture(scope="session")
def walk() -> Walk:
    """A body that walks in a way that is known exactly."""
    return make_walk()
