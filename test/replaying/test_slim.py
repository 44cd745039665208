"""A replay that keeps no tracks and no landmarks."""

import json
from pathlib import Path

import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample

from bodycam_ros.cli.main import main
from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.results.solved_recording import read_solved


@pytest.fixture(scope="module")
def outs(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Path]:
    """The same stretch with all that there is, and slim."""
    folder = tmp_path_factory.mktemp("slim")
    bag = write_altered_sample(sample, folder / "bag")
    given = ["replay", str(bag), "--map", str(sample / "map"), "--body", str(sample / "body.yaml"), "--jobs", "1", "-o"]
    assert main([*given, str(folder / "full")]) == 0
    assert main([*given, str(folder / "thin"), "--slim"]) == 0
    return folder / "full", folder / "thin"


def size(bag: Path) -> int:
    return sum(file.stat().st_size for file in bag.iterdir())


def test_it_is_smaller_and_says_the_same_of_body_and_cameras(outs: tuple[Path, Path]) -> None:
    full, thin = map(read_solved, outs)
    assert size(outs[1]) < size(outs[0])
    with BagFile(outs[1]) as bag:
        assert not [topic for topic in bag.topics if topic.endswith("/tracks")]
    assert np.array_equal(full.stamps_ns, thin.stamps_ns)
    for link, poses in full.world_T_link.items():
        assert np.array_equal(poses, thin.world_T_link[link])
    for before, after in zip(full.cameras, thin.cameras, strict=True):
        assert before.landmarks.all() and not after.landmarks.any()
        assert np.array_equal(before.world_T_camera, after.world_T_camera)
        assert np.array_equal(before.sights, after.sights)


def test_it_can_be_evaluated_and_says_nothing_of_what_it_lacks(outs: tuple[Path, Path], tmp_path: Path) -> None:
    assert main(["evaluate", str(outs[1]), "-o", str(tmp_path / "report")]) == 0
    cameras = json.loads((tmp_path / "report" / "summary.json").read_text())["cameras"]
    assert {camera["landmarks"] for camera in cameras.values()} == {None}
    assert {camera["registered"] for camera in cameras.values()} == {1.0}
