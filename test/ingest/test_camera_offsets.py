from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from itertools import islice
from types import MappingProxyType

import numpy as np
import pytest
from helpers.clapped_sound import Recorder, sources, true_start, worst_errors
from helpers.naming import naming
from helpers.recorded_progress import Unshown

from bodycam_ros.errors import RecordingError
from bodycam_ros.ingest import camera_offsets
from bodycam_ros.ingest.camera_offsets import Offsets, TimeSource
from bodycam_ros.ingest.clock_fit import CameraTime
from bodycam_ros.progress import Advance, Progress
from bodycam_ros.recording.sound import SoundBlock, SoundSource

CLAPS = {3.5: 0.8, 14.2: 0.9}


def camera_times(
    sounds: Mapping[str, SoundSource],
    sources: Mapping[str, TimeSource] = MappingProxyType({}),
    progress: Progress | None = None,
) -> Offsets:
    return camera_offsets.camera_times(sounds, None, sources, progress or Unshown())


RECORDERS = {
    "waist": Recorder(0.0, 16.0, noise=0.004),
    "head": Recorder(1.31, 16.4, drift=20e-6, way_m=0.4, gain=0.4, noise=0.01),
    "foot": Recorder(2.07, 16.2, drift=-30e-6, way_m=0.7, gain=1.4, own=(5.0, 8.1)),
    "shin": Recorder(0.42, 15.8, way_m=0.5, rate_hz=44100),
}


def test_a_minute_of_claps_gives_starts_and_drifts_through_aac() -> None:
    recorders = {
        "waist": Recorder(0.0, 62.0, noise=0.01),
        "head": Recorder(1.3, 62.5, drift=60e-6, gain=0.3),
        "foot": Recorder(2.6, 61.7, drift=-45e-6, gain=1.5, noise=0.003, own=(11.0, 30.3, 44.0)),
        "shin": Recorder(0.7, 62.2, drift=100e-6, noise=0.02, rate_hz=44100),
    }
    offsets = camera_times(sources(recorders, {3.0: 0.7, 60.8: 0.9}, aac=True))
    start_error, drift_error = worst_errors(recorders, offsets.reference, offsets.times)
    assert start_error < 2e-3
    assert drift_error < 5e-5
    assert {time.source for time in offsets.times.values()} == {"sound"}


def test_travel_is_within_the_error_budget() -> None:
    offsets = camera_times(sources(RECORDERS, CLAPS))
    for name, time in offsets.times.items():
        error = abs(time.start_s - true_start(RECORDERS, name, offsets.reference))
        assert error <= 3.0 * time.start_sigma_s
        assert error < 3e-3


@pytest.mark.parametrize(
    "case",
    [
        pytest.param({"waist": {"clip": 0.2}, "foot": {"clip": 0.25}}, id="clap clipped"),
        pytest.param({"head": {"muffled_hz": 900.0}}, id="a camera muffled"),
        pytest.param(
            {"head": {"echoes": ((0.0052, 1.4),)}, "shin": {"echoes": ((0.0064, -1.5),)}},
            id="echoes from the floor",
        ),
        pytest.param({"foot": {"deaf_to": (14.2,)}}, id="a clap not heard by one"),
        pytest.param(
            {"foot": {"own": (4.4, 6.0, 6.1, 9.0, 9.2, 12.0, 13.5)}, "head": {"own": (7.0, 13.9)}}, id="bumps"
        ),
    ],
)
def test_cameras_with_a_fault(case: dict[str, dict[str, object]]) -> None:
    recorders = {name: replace(recorder, **case.get(name, {})) for name, recorder in RECORDERS.items()}
    offsets = camera_times(sources(recorders, CLAPS))
    assert set(offsets.times) == set(recorders)
    assert worst_errors(recorders, offsets.reference, offsets.times)[0] < 3e-3


def test_two_claps_too_many_and_a_dribbled_ball() -> None:
    bounces = {4.5 + 0.47 * n + 0.02 * np.sin(5.0 * n): 0.25 for n in range(19)}
    offsets = camera_times(sources(RECORDERS, {3.5: 0.8, 4.1: 0.8, 13.9: 0.8, 14.2: 0.9} | bounces))
    assert worst_errors(RECORDERS, offsets.reference, offsets.times)[0] < 3e-3
    assert set(offsets.times) == set(RECORDERS)


@pytest.mark.parametrize(
    "camera", [{"late": Recorder(5.0, 16.0, way_m=0.3)}, {"early": Recorder(0.8, 12.0, way_m=0.3)}]
)
def test_a_camera_that_misses_the_first_clap_or_the_last(camera: dict[str, Recorder]) -> None:
    recorders = RECORDERS | camera
    offsets = camera_times(sources(recorders, CLAPS))
    assert not offsets.unplaced
    assert worst_errors(recorders, offsets.reference, offsets.times)[0] < 3e-3


def test_without_claps_the_sound_as_a_whole_decides() -> None:
    random = np.random.default_rng(1)
    loudness = 0.02 * np.exp(np.convolve(random.normal(size=40 * 2000), np.hanning(240), "same") * 0.1)
    recorders = {name: replace(r, end_s=r.end_s + 20.0, way_m=0.0, own=()) for name, r in RECORDERS.items()}
    offsets = camera_times(sources(recorders, {}, background=loudness))
    assert {time.source for time in offsets.times.values()} == {"sound"}
    assert worst_errors(recorders, offsets.reference, offsets.times)[0] < 3e-3


def test_noise_alone_places_nobody() -> None:
    with naming(RecordingError, *RECORDERS):
        camera_times(sources({name: replace(r, own=()) for name, r in RECORDERS.items()}, {}))


def test_deaf_and_silent_cameras_are_named_and_the_others_placed() -> None:
    heard = sources(RECORDERS | {"silent": Recorder(0.0, 16.0, gain=0.0)}, CLAPS) | {"deaf": lambda: iter(())}
    offsets = camera_times(heard)
    causes = {name: why.split(";")[0] for name, why in offsets.unplaced.items()}
    assert causes == {"silent": "its sound is silence", "deaf": "it has no sound"}
    assert set(offsets.times) == set(RECORDERS)


def known(starts: dict[str, float], sigma_s: float = 1e-4) -> dict[str, TimeSource]:
    """A source that knows some starts."""
    times = {n: CameraTime(s, 0.0, sigma_s, 1e-5, "motion", 0.8) for n, s in starts.items()}
    causes = {"waist": "fits nowhere"} if "deaf" in starts else {}
    return {"motion": lambda placed: (times, causes)}


def test_another_source_places_a_camera_without_sound() -> None:
    heard = sources(RECORDERS, CLAPS) | {"deaf": lambda: iter(())}
    starts = {name: recorder.start_s for name, recorder in RECORDERS.items()} | {"deaf": 1.7}
    offsets = camera_times(heard, sources=known(starts))
    assert not offsets.unplaced
    for name, time in offsets.times.items():
        assert abs(time.start_s - (starts[name] - starts[offsets.reference])) < 3e-3
    assert offsets.times["deaf"].source == "motion" and offsets.times["deaf"].confidence == 0.8
    assert not any(camera == "waist" for camera, _ in offsets.remarks), "its sound gives its clock"


def test_a_source_that_contradicts_is_left_out_and_named() -> None:
    starts = {name: recorder.start_s for name, recorder in RECORDERS.items()}
    plain = camera_times(sources(RECORDERS, CLAPS))
    wrong = next(name for name in starts if name != plain.reference)
    told = camera_times(sources(RECORDERS, CLAPS), sources=known(starts | {wrong: starts[wrong] + 0.2}))
    assert abs(told.times[wrong].start_s - plain.times[wrong].start_s) < 1e-6
    ((camera, remark),) = told.remarks
    assert camera == wrong and " ms later than by its sound" in remark and remark.endswith("its sound is used")


def test_a_sound_that_breaks_off_is_named_and_what_was_heard_counts() -> None:
    heard = sources(RECORDERS | {"late": Recorder(2.2, 16.0)}, CLAPS)
    whole = heard["late"]

    def broken() -> Iterator[SoundBlock]:
        for block in whole():
            if block.start_s > 13.0:
                raise RecordingError("late.mp4: ends in the middle of a packet")
            yield block

    offsets = camera_times(heard | {"late": broken})
    assert ("late", "late.mp4: ends in the middle of a packet") in offsets.remarks
    assert (
        abs(
            offsets.times["late"].start_s
            - true_start(RECORDERS | {"late": Recorder(2.2, 16.0)}, "late", offsets.reference)
        )
        < 3e-3
    )


def test_an_interruption_does_not_wait_for_the_rest_of_the_sound() -> None:
    taken = []

    def endless() -> Iterator[SoundBlock]:
        for second in range(100_000):
            taken.append(second)
            yield SoundBlock(float(second), np.zeros(48000, np.float32), 48000.0)

    class Interrupted(Unshown):
        @contextmanager
        def step(self, name: str, total: int) -> Iterator[Advance]:
            def advance(units: int = 1) -> None:
                raise KeyboardInterrupt

            yield advance

    with pytest.raises(KeyboardInterrupt):
        camera_times({"one": lambda: islice(endless(), 1), "two": endless}, progress=Interrupted())
    assert len(taken) < 10_000


def test_the_reference_is_at_zero_even_if_no_sound_placed_anybody() -> None:
    silent = {name: (lambda: iter(())) for name in ("one", "two", "three")}
    offsets = camera_times(silent, sources=known({"one": 5.0, "two": 6.5, "three": 4.0}))
    assert offsets.times[offsets.reference].start_s == 0.0
    assert offsets.times["two"].start_s - offsets.times["three"].start_s == pytest.approx(2.5)


def test_who_is_placed_by_a_rough_clock_alone_is_named() -> None:
    heard = sources(RECORDERS, CLAPS) | {"deaf": lambda: iter(())}
    starts = {name: recorder.start_s for name, recorder in RECORDERS.items()} | {"deaf": 1.7}
    offsets = camera_times(heard, sources=known({"deaf": starts["deaf"]} | starts, sigma_s=1.0))
    expected = ("deaf", "it has no sound; its start was found by its motion, to 1 s only: record a clap")
    assert expected in offsets.remarks


def test_images_are_known_less_well_than_the_sound_beside_them() -> None:
    """The first image is exposed up to a frame after the first sound, and no file tells when."""
    sounds = sources(RECORDERS, CLAPS)
    alone = camera_offsets.camera_times(sounds, None, {}, Unshown())
    beside = camera_offsets.camera_times(sounds, None, {}, Unshown(), dict.fromkeys(RECORDERS, 1.0 / 24.0))
    for name, time in beside.times.items():
        if name == beside.reference:
            assert time.start_sigma_s == 0.0
            continue
        assert time.start_s == alone.times[name].start_s
        # Late by a uniform share of a frame each: their difference has a sigma of a frame over the root of six.
        expected_s = np.hypot(alone.times[name].start_sigma_s, 1.0 / 24.0 / np.sqrt(6.0))
        assert time.start_sigma_s == pytest.approx(expected_s)


def test_the_reference_alone_has_another_date_and_it_alone_is_named() -> None:
    """Its time is the recording's by its sound; the clock that dates its file may be minutes off like any other."""
    heard = sources(RECORDERS, CLAPS) | {"deaf": lambda: iter(())}
    starts = {name: recorder.start_s for name, recorder in RECORDERS.items()} | {"deaf": 1.7}
    plain = camera_times(heard, sources=known(starts))
    dated = starts | {plain.reference: starts[plain.reference] + 300.0}
    offsets = camera_times(heard, sources=known(dated, sigma_s=1.0))
    assert [camera for camera, remark in offsets.remarks if "300.0 s later" in remark] == [plain.reference]
    assert {camera for camera, _ in offsets.remarks} == {plain.reference, "deaf"}
    assert offsets.times["deaf"].start_s == pytest.approx(plain.times["deaf"].start_s, abs=0.01)


def test_why_a_camera_has_no_clock_is_one_sentence_with_all_causes() -> None:
    heard = sources(RECORDERS, CLAPS) | {"deaf": lambda: iter(())}
    nothing: dict[str, TimeSource] = {"motion": lambda placed: ({}, {"deaf": "its images are dark"})}
    offsets = camera_times(heard, sources=nothing)
    assert offsets.unplaced["deaf"].startswith("it has no sound; its images are dark; record a clap")
    assert not offsets.remarks
