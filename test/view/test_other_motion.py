"""Two solutions of one recording, beside each other."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from known_walk import FRAME_NS, START_NS, Walk, write_solved

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import ViewError
from bodycam_ros.registration.camera_sight import CameraSight
from bodycam_ros.view.camera_bands import read_bands
from bodycam_ros.view.motion import Motion, read_motion
from bodycam_ros.view.other_motion import read_other_motion
from bodycam_ros.view.sources import Sources

STAMPS = START_NS + FRAME_NS * np.arange(3, dtype=np.int64)


@pytest.fixture
def body(sample: Path) -> BodyModel:
    return replace(read_body(sample / "body.yaml"), mounts={})


def standing(
    body: BodyModel, folder: Path, shift_m: float, stamps: "np.ndarray[tuple[int], np.dtype[np.int64]]"
) -> Path:
    poses = np.stack([Motion.standing(body).segments_at(body, 0)] * len(stamps))
    poses[:, :, 0, 3] += shift_m
    return write_solved(Walk(body, stamps, poses), folder)


def test_the_other_solution_is_as_far_away_as_it_is(body: BodyModel, tmp_path: Path) -> None:
    out, other = (standing(body, tmp_path / name, shift, STAMPS) for name, shift in (("a", 0.0), ("b", 0.02)))
    motion = read_motion(out, body)
    compared = read_other_motion(other, motion)
    poses = motion.segments_at(body, 1)
    places = dict(zip(body.segments, poses[:, :3, 3], strict=True))
    apart = compared.apart_m(places, int(STAMPS[1]), FRAME_NS // 2)
    assert len(apart) == len(body.segments) and np.allclose(apart, 0.02, atol=1e-6)
    assert {line.segment for line in compared.lines_at(int(STAMPS[1]), 1)} >= {"head", "shin_left"}
    assert len(compared.apart_m(places, int(STAMPS[2]) + 5 * FRAME_NS, FRAME_NS)) == 0
    assert set(compared.angles) == set(motion.angle_names)


def test_a_solution_of_another_recording_is_refused(
    body: BodyModel, sample: Path, body_file: Path, tmp_path: Path
) -> None:
    out = standing(body, tmp_path / "a", 0.0, STAMPS)
    later = standing(body, tmp_path / "b", 0.0, STAMPS + 10**12)
    with pytest.raises(ViewError, match="from another recording"):
        Sources.read(out, sample / "map", body_file, None, compare=later)
    with pytest.raises(ViewError, match="name OUT too"):
        Sources.read(None, sample / "map", body_file, None, compare=later)


def test_bands_are_of_all_cameras_in_the_order_of_the_body(sample: Path, sample_out: Path) -> None:
    body = read_body(sample / "body.yaml")
    motion = read_motion(sample_out, body)
    bands = read_bands(sample_out, int(motion.stamps_ns[0]), tuple(body.mounts))
    assert list(bands) == list(body.mounts)
    for seconds, sights in bands.values():
        assert len(seconds) == len(sights) == 60 and (sights == CameraSight.REGISTERED).all()
        assert seconds[0] == pytest.approx(0.0, abs=0.02) and seconds[-1] == pytest.approx(59 / 30, abs=0.02)
