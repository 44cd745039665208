"""bodycam map extend and bodycam replay --passes as a user calls them, on a stretch of the sample."""

import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
from helpers.altered_sample import write_altered_sample
from helpers.tiny_bag import write_tiny_bag

from benchmarks.half_map import half_map
from bodycam_ros.cli.main import main
from bodycam_ros.files.whole_file import SCRATCH_PREFIX
from bodycam_ros.registration.reference_map import ReferenceMap

pytestmark = pytest.mark.long

CAMERAS = ("waist_front", "torso_front", "thigh_left")


@pytest.fixture(scope="module")
def part(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The sample's map without the photographs that look to one side."""
    path = tmp_path_factory.mktemp("part") / "map"
    half_map(ReferenceMap.load(sample / "map"), 180.0).save(path)
    return path


@pytest.fixture(scope="module")
def stretch(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A second and a half of three cameras."""
    return write_altered_sample(sample, tmp_path_factory.mktemp("stretch") / "bag", cameras=CAMERAS, frames=45)


def run(*arguments: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, "-m", "bodycam_ros.cli.main", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=300)


def test_a_map_is_extended_drawn_and_used(part: Path, stretch: Path, tmp_path: Path) -> None:
    out = tmp_path / "longer"
    done = run("map", "extend", stretch, "--map", part, "-o", out, "--jobs", 2, "--extension.rounds", 2)
    assert done.returncode == 0, done.stderr
    assert "registered images" in done.stdout and "thigh_left" in done.stdout
    before, after = ReferenceMap.load(part), ReferenceMap.load(out)
    settled = len(before.landmark_ids)
    assert after.grown == len(after.landmark_ids) - settled > 20
    np.testing.assert_array_equal(after.points_world[:settled], before.points_world)
    assert f"{after.grown} landmarks added by body cameras" in " ".join(done.stdout.split())
    assert {name.split("/")[0] for name in after.image_names[len(before.image_names) :]} <= set(CAMERAS)
    picture = cv2.imread(str(out / "coverage.png"))
    assert picture is not None and picture.std() > 5
    # It is a map like any other: it is replaced only where that is wanted.
    refused = run("map", "extend", stretch, "--map", out, "-o", out, "--force")
    assert refused.returncode == 1 and str(out) in refused.stderr
    again = run("map", "extend", stretch, "--map", part, "-o", out)
    assert again.returncode == 1 and "--force" in again.stderr and str(out) in again.stderr


def test_the_map_is_the_same_whatever_the_number_of_processes(sample: Path, part: Path, tmp_path: Path) -> None:
    """Images of one stamp come in another order from two processes than from one."""
    seen = ("torso_back", "thigh_right", "shin_right", "forearm_right")
    bag, made = write_altered_sample(sample, tmp_path / "bag", cameras=seen, frames=30), []
    for jobs in ("1", "2"):
        out = tmp_path / jobs
        arguments = [str(bag), "--map", str(part), "-o", str(out), "--jobs", jobs, "--extension.rounds", "1"]
        assert main(["map", "extend", *arguments]) == 0
        made.append(ReferenceMap.load(out))
    assert made[0].grown > 20
    for name in ("points_world", "descriptors", "world_T_camera"):
        np.testing.assert_array_equal(getattr(made[0], name), getattr(made[1], name))


def test_replay_in_passes_solves_with_what_has_grown(sample: Path, part: Path, stretch: Path, tmp_path: Path) -> None:
    common = ("--map", part, "--body", sample / "body.yaml", "--jobs", 2)
    done = run("replay", stretch, *common, "--passes", 2, "-o", tmp_path / "out")
    assert done.returncode in (0, 3), done.stderr
    assert "round 1" in done.stdout and "45 of 45 frames solved" in " ".join(done.stdout.split())
    assert [path.name for path in tmp_path.iterdir()] == ["out"]
    refused = run("replay", stretch, *common, "--passes", 0, "-o", tmp_path / "other")
    assert refused.returncode == 2 and "--passes" in refused.stderr


def test_what_is_wrong_is_named(part: Path, stretch: Path, tmp_path: Path) -> None:
    nowhere, out = tmp_path / "nowhere", tmp_path / "out"
    for bag, map_path in ((stretch, nowhere), (nowhere, part)):
        done = run("map", "extend", bag, "--map", map_path, "-o", out)
        assert done.returncode == 1 and str(nowhere) in done.stderr and "Traceback" not in done.stderr
    assert list(tmp_path.iterdir()) == []


def test_a_recording_in_which_nothing_registers_leaves_the_map_as_it_was(
    part: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Grey images; the map that comes out is the one that went in, and the picture says so."""
    bag, out = write_tiny_bag(tmp_path / "bag"), tmp_path / "out"
    assert main(["map", "extend", str(bag), "--map", str(part), "-o", str(out), "--jobs", "1"]) == 0
    before, after = ReferenceMap.load(part), ReferenceMap.load(out)
    np.testing.assert_array_equal(before.landmark_ids, after.landmark_ids)
    np.testing.assert_array_equal(before.descriptors, after.descriptors)
    assert after.grown == 0 and after.image_names == before.image_names
    assert cv2.imread(str(out / "coverage.png")) is not None


def test_a_map_without_photographs_grows_too(part: Path, stretch: Path, tmp_path: Path) -> None:
    bare = shutil.copytree(part, tmp_path / "bare")
    (bare / "photographs.npz").unlink()
    out = tmp_path / "out"
    arguments = [str(stretch), "--map", str(bare), "-o", str(out), "--jobs", "2", "--extension.rounds", "1"]
    assert main(["map", "extend", *arguments]) == 0
    after = ReferenceMap.load(out)
    assert after.photographs is None and after.grown > 20
    assert len(after.world_T_camera) == len(after.image_names) > len(ReferenceMap.load(part).image_names)


@pytest.fixture
def scratch() -> Iterator[Path]:
    """A folder for scratch files with a short name: a socket's path has no more than 108 letters."""
    with tempfile.TemporaryDirectory() as folder:
        yield Path(folder)


def test_ctrl_c_leaves_nothing_behind(part: Path, stretch: Path, scratch: Path, tmp_path: Path) -> None:
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "map", "extend", str(stretch), "--map", str(part)]
    process = subprocess.Popen(
        [*command, "-o", str(tmp_path / "out"), "--jobs", "2"],
        stderr=subprocess.PIPE,
        text=True,
        start_new_session=True,
        env={**os.environ, "TMPDIR": str(scratch)},
    )
    deadline = time.monotonic() + 120.0
    while not list(scratch.glob(f"{SCRATCH_PREFIX}*")) and process.poll() is None and time.monotonic() < deadline:
        time.sleep(0.02)
    time.sleep(0.5)
    process.send_signal(signal.SIGINT)
    _, errors = process.communicate(timeout=120)
    assert process.returncode == 130 and "Traceback" not in errors, errors
    assert list(tmp_path.iterdir()) == []
    assert not list(scratch.glob(f"{SCRATCH_PREFIX}*"))
