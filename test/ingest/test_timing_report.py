import io
from pathlib import Path

import pytest
import yaml
from clapped_sound import Recorder, sources, true_start

from bodycam_ros.ingest.camera_offsets import Offsets, camera_times
from bodycam_ros.ingest.timing_picture import draw_timing
from bodycam_ros.ingest.timing_report import timing_table, write_timing
from bodycam_ros.terminal import Terminal

RECORDERS = {
    "waist_front": Recorder(0.0, 12.0),
    "head": Recorder(1.31, 12.4, way_m=0.4, gain=0.4, noise=0.01),
    "foot_left": Recorder(2.07, 12.2, way_m=0.7, gain=1.4, own=(5.0, 8.1)),
}


@pytest.fixture(scope="module")
def offsets() -> Offsets:
    return camera_times(sources(RECORDERS, {3.0: 0.8, 11.0: 0.9}) | {"shin_left": lambda: iter(())})


def test_the_file_holds_what_was_found(offsets: Offsets, tmp_path: Path) -> None:
    read = yaml.safe_load(write_timing(offsets, tmp_path).read_text(encoding="utf-8"))
    assert set(read["cameras"]) == set(RECORDERS)
    for name, clock in read["cameras"].items():
        assert clock["start_s"] == pytest.approx(true_start(RECORDERS, name, read["reference"]), abs=3e-3)
        assert clock["source"] == "claps"
    assert read["unplaced"] == {"shin_left": "has no sound"}
    assert len(read["claps"]) == 2
    clock = read["cameras"]["head"]
    for clap in read["claps"]:
        recording_s = clock["start_s"] + (1.0 + 1e-6 * clock["drift_ppm"]) * clap["heard_s"]["head"]
        assert 1e3 * (recording_s - clap["recording_s"]) == pytest.approx(clap["late_ms"]["head"], abs=0.01)


def test_the_table_names_every_camera(offsets: Offsets) -> None:
    written = io.StringIO()
    Terminal(width=80, file=written).print(timing_table(offsets))
    text = written.getvalue()
    for name in [*RECORDERS, "shin_left", "reference", "has no sound"]:
        assert name in text


def test_the_picture_is_drawn_with_and_without_claps(offsets: Offsets, tmp_path: Path) -> None:
    draw_timing(offsets, tmp_path / "claps.png")
    bare = Offsets(offsets.reference, offsets.times, offsets.confidence, heard=offsets.heard)
    draw_timing(bare, tmp_path / "none.png")
    for file in ("claps.png", "none.png"):
        assert (tmp_path / file).read_bytes().startswith(b"\x89PNG")
