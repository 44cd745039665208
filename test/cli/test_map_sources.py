"""bodycam map of a video, and what it says of the coverage, on photographs of the sample."""

import shutil
from fractions import Fraction
from pathlib import Path

import av
import cv2
import numpy as np
import pytest
import yaml

from bodycam_ros.cli.main import main
from bodycam_ros.registration.reference_map import ReferenceMap

QUICK = ["--features.max_features", "1200", "--jobs", "2"]
NEAR = ["ref_0099.jpg", "ref_0101.jpg", "ref_0103.jpg", "ref_0105.jpg"]
SHARP = [1, 4, 7, 10]
RATE_HZ = 10


def walk(sample: Path) -> list[np.ndarray]:
    """Four photographs, each between two pictures that are blurred by motion."""
    frames = []
    for name in NEAR:
        photograph = cv2.imread(str(sample / "reference" / name))
        assert photograph is not None
        blurred = cv2.blur(photograph, (25, 1))
        frames += [blurred, photograph, blurred]
    return frames


@pytest.fixture(scope="module")
def video(sample: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The walk as MP4, its lens and the board's description beside it."""
    folder = tmp_path_factory.mktemp("filmed")
    with av.open(str(folder / "walk.mp4"), "w") as container:
        frames = walk(sample)
        stream = container.add_stream("libx264", rate=RATE_HZ)
        stream.height, stream.width = frames[0].shape[:2]
        stream.pix_fmt = "yuv420p"
        stream.codec_context.options = {"crf": "12", "preset": "ultrafast"}
        for number, pixels in enumerate(frames):
            frame = av.VideoFrame.from_ndarray(pixels, format="bgr24")
            frame.pts, frame.time_base = number, Fraction(1, RATE_HZ)
            container.mux(stream.encode(frame))
        container.mux(stream.encode(None))
    shutil.copy(sample / "reference" / "camera.yaml", folder / "walk.yaml")
    shutil.copy(sample / "reference" / "board.yaml", folder / "board.yaml")
    return folder / "walk.mp4"


def expect_error(arguments: list[object], capsys: pytest.CaptureFixture[str], *words: str) -> None:
    assert main(["map", *map(str, arguments)]) == 1
    message = capsys.readouterr().err.replace("\n", " ")
    assert "Traceback" not in message
    for word in words:
        assert word in message, message


def test_a_map_is_made_of_the_sharp_frames_of_a_video(
    video: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "scratch").mkdir()
    monkeypatch.setenv("TMPDIR", str(tmp_path / "scratch"))
    path = tmp_path / "map"
    assert main(["map", str(video), "-o", str(path), *QUICK]) == 0
    said = capsys.readouterr().out
    reference_map = ReferenceMap.load(path)
    names = tuple(f"frame_{number:06d}.jpg" for number in SHARP)
    assert reference_map.image_names == names
    assert reference_map.metric and reference_map.gravity_aligned
    assert list((tmp_path / "scratch").iterdir()) == []

    summary = yaml.safe_load((path / "map.yaml").read_text())
    assert summary["reference"] == "walk.mp4"
    # Four photographs of a floor do not cover a hall; the picture and the sentences say so.
    assert 0.0 <= summary["coverage"]["share"] < 0.5 and summary["coverage"]["gaps"]
    assert "photograph more too: all around" in said and "coverage.png" in said
    assert cv2.imread(str(path / "coverage.png")) is not None


def test_a_source_that_is_missing_or_a_bag_is_refused(
    tiny_bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = ["-o", tmp_path / "map"]
    expect_error([tmp_path / "nowhere.mp4", *out], capsys, "no such folder or file")
    expect_error([tiny_bag, *out], capsys, "is a bag", "--from-bag")
    assert list(tmp_path.iterdir()) == [tiny_bag]


def test_a_video_that_stands_still_or_is_none_makes_no_map(
    video: Path,
    sample: Path,
    tiny_bag: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    caplog: pytest.LogCaptureFixture,
) -> None:
    (tmp_path / "torn.mp4").write_bytes(video.read_bytes()[:3000])
    lens = sample / "reference" / "camera.yaml"
    expect_error([tmp_path / "torn.mp4", "--camera", lens, "-o", tmp_path / "map"], capsys, "torn.mp4", "cut-off")
    assert not caplog.messages
    # What a map without scale lacks is warned of before the work that fails here.
    expect_error(["--from-bag", tiny_bag, "-o", tmp_path / "map"], capsys, "shows anything")
    (warned,) = caplog.messages
    assert all(way in warned for way in ("not be metric", "--board", "--known-distance", "--imu"))
    assert not (tmp_path / "map").exists()
