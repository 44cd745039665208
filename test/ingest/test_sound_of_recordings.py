"""Starts and drifts from the sound of rendered recordings against their truth."""

from collections.abc import Iterator
from pathlib import Path

import av
import pytest
import yaml

from bodycam_ros.ingest.camera_offsets import camera_times
from bodycam_ros.ingest.sound_peaks import scan_sound
from bodycam_ros.ingest.sound_settings import ClockSettings, PeakSettings, SoundSettings, WholeSoundSettings
from bodycam_ros.ingest.whole_sound import compare_sounds
from bodycam_ros.video.sound import SoundBlock, SoundSource

RECORDINGS = Path(__file__).parents[3] / "shared/recordings"
NAMES = ("dev_gopro_rom", "dev_gopro_walk")

pytestmark = pytest.mark.skipif(
    not all((RECORDINGS / name).is_dir() for name in NAMES), reason="the recordings with MP4s are not beside the clone"
)


def sound_of_file(path: Path) -> SoundSource:
    def blocks() -> Iterator[SoundBlock]:
        with av.open(str(path)) as container:
            for frame in container.decode(audio=0):
                assert frame.pts is not None and frame.time_base is not None
                yield SoundBlock(float(frame.pts * frame.time_base), frame.to_ndarray()[0], frame.sample_rate)

    return blocks


def sounds_of(recording: str) -> dict[str, SoundSource]:
    return {file.stem: sound_of_file(file) for file in sorted((RECORDINGS / recording / "mp4").glob("*.mp4"))}


def true_starts(recording: str, reference: str) -> dict[str, float]:
    truth = yaml.safe_load((RECORDINGS / recording / "truth/clock_offsets.yaml").read_text(encoding="utf-8"))
    before = {camera: entry["start_offset"] for camera, entry in truth.items()}
    return {camera: before[reference] - early for camera, early in before.items()}


@pytest.mark.parametrize("recording", NAMES)
def test_claps_place_all_cameras(recording: str) -> None:
    rig = yaml.safe_load((RECORDINGS / recording / "rig.yaml").read_text(encoding="utf-8"))
    offsets = camera_times(sounds_of(recording), rig["cameras"])
    assert {time.source for time in offsets.times.values()} == {"claps"}
    assert len(offsets.claps) == 2 and not offsets.unplaced
    true = true_starts(recording, offsets.reference)
    for camera, time in offsets.times.items():
        # Clocks of these cameras do not drift; from clap to clap the ways of sound change.
        assert abs(time.start_s - true[camera]) < 2e-3
        assert abs(time.start_s - true[camera]) <= 3.0 * time.start_sigma_s
        assert abs(time.drift) <= 3.0 * time.drift_sigma


@pytest.mark.parametrize("recording", NAMES)
def test_the_sound_as_a_whole_would_do(recording: str) -> None:
    heard = {name: scan_sound(source(), PeakSettings()) for name, source in sounds_of(recording).items()}
    result = compare_sounds(heard, {}, WholeSoundSettings(), ClockSettings())
    assert set(result.times) == set(heard)
    true = true_starts(recording, result.reference)
    assert max(abs(time.start_s - true[camera]) for camera, time in result.times.items()) < 3e-3


def test_cameras_that_heard_one_clap_only_are_placed_and_named() -> None:
    sounds = sounds_of("dev_gopro_rom")
    names = list(sounds)

    def cut(source: SoundSource, begin_s: float, end_s: float) -> SoundSource:
        return lambda: (block for block in source() if begin_s <= block.start_s < end_s)

    sounds[names[3]] = cut(sounds[names[3]], 4.0, 99.0)
    sounds[names[8]] = cut(sounds[names[8]], 0.0, 7.0)
    offsets = camera_times(sounds, settings=SoundSettings())
    true = true_starts("dev_gopro_rom", offsets.reference)
    assert not offsets.unplaced
    assert max(abs(time.start_s - true[camera]) for camera, time in offsets.times.items()) < 3e-3
    for camera in (names[3], names[8]):
        assert any(remark.startswith(f"{camera}: ") for remark in offsets.remarks)
