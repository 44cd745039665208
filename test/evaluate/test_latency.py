"""Latency by stage, from moments whose stages are known."""

from pathlib import Path

import numpy as np
import pytest

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.latency import STAGES, cost_of_image, latency_of
from bodycam_ros.moments import Instant, Moment, Moments, Noted, read_moments

_MS = 1_000_000
_FRAME_NS = 33_333_333
_FIRST_NS = 1_000_000_000
_ON_THE_WAY = (Moment.PLAYED, Moment.IMAGE_HEARD, Moment.TRACKING, Moment.TRACKED)
_THEN = (Moment.TRACKS_HEARD, Moment.REGISTERED, Moment.LANDMARKS_HEARD)


def _of_camera(camera: str, stamp_ns: int, at_ms: tuple[float, ...], frame: int) -> list[Noted]:
    start_ns = 50 * frame * _MS
    return [
        Noted(moment, camera, stamp_ns, Instant(start_ns + round(ms * _MS), 7 * frame * _MS))
        for moment, ms in zip((*_ON_THE_WAY, *_THEN), at_ms, strict=True)
    ]


def _run(frames: int, queue_ms: float = 0.0) -> dict[str, list[Noted]]:
    """Two cameras; the right one is slower, and published 2 ms after the left one."""
    noted: dict[str, list[Noted]] = {"cameras": [], "solver": []}
    for frame in range(frames):
        stamp_ns, late = _FIRST_NS + frame * _FRAME_NS, queue_ms * frame
        noted["cameras"] += _of_camera("left", stamp_ns, (0.0, 1.0, 1.0, 6.0, 7.0, 8.0, 9.0), frame)
        right = (2.0, 3.0, 3.5 + late, 11.5 + late, 12.5 + late, 15.5 + late, 16.0 + late)
        noted["cameras"] += _of_camera("right", stamp_ns + 100_000, right, frame)
        for moment, ms in ((Moment.SOLVING, 20.0), (Moment.SOLVED, 24.0)):
            at = Instant(50 * frame * _MS + round((ms + late) * _MS), 9 * frame * _MS)
            noted["solver"].append(Noted(moment, "", stamp_ns, at))
    return noted


def _all(noted: dict[str, list[Noted]]) -> list[Noted]:
    return [note for notes in noted.values() for note in notes]


def test_the_stages_of_the_camera_that_was_waited_for_add_up() -> None:
    latency = latency_of(_all(_run(40)))
    assert len(latency.stamps_ns) == 13
    expected_ms = dict(play=2.0, track=8.0, register=3.0, way=1.0 + 0.5 + 1.0 + 0.5, later=4.0, solve=4.0)
    np.testing.assert_allclose(1e3 * latency.stages_s, np.tile([expected_ms[s] for s in STAGES], (13, 1)), atol=1e-6)
    np.testing.assert_allclose(1e3 * latency.total_s, 24.0, atol=1e-6)
    np.testing.assert_allclose(1e3 * latency.total_in_real_time_s(0.25), 21.0, atol=1e-6)


def test_queueing_shows_on_the_way() -> None:
    assert latency_of(_all(_run(40))).way_s < 0.004
    assert latency_of(_all(_run(40, queue_ms=2.0))).way_s > 0.033
    assert latency_of([]).way_s == float("inf")


def test_frames_that_came_only_half_the_way_are_left_out() -> None:
    notes = _all(_run(40))
    lost_ns = _FIRST_NS + 30 * _FRAME_NS
    without = [n for n in notes if not (n.camera == "right" and abs(n.stamp_ns - lost_ns) < _MS)]
    latency = latency_of(without)
    (row,) = np.flatnonzero(latency.stamps_ns == lost_ns)
    assert latency.stages_s[row, 0] == 0.0 and latency.stages_s[row, 1] == pytest.approx(0.005)


def test_moments_are_written_and_read_or_refused(tmp_path: Path) -> None:
    Moments(None).note(Moment.TRACKED, "left", 5)
    moments = Moments(tmp_path / "moments.csv")
    moments.note(Moment.TRACKED, "left", 5)
    moments.note(Moment.SOLVED, "", 6, Instant(7, 8))
    moments.write()
    first, second = read_moments(tmp_path / "moments.csv")
    assert first[:3] == (Moment.TRACKED, "left", 5) and first.at.steady_ns > 0
    assert second == Noted(Moment.SOLVED, "", 6, Instant(7, 8))
    (tmp_path / "other.csv").write_text("a,b\n")
    for name in ("other.csv", "none.csv"):
        with pytest.raises(RecordingError, match=name):
            read_moments(tmp_path / name)


def test_the_cost_of_an_image_is_that_of_all_processes_while_it_is_played() -> None:
    def noted(moment: Moment, ms: float, cpu_ms: float) -> Noted:
        return Noted(moment, "left", _FIRST_NS, Instant(round(ms * _MS), round(cpu_ms * _MS)))

    # An image every 10 ms. The player takes 1 ms of each, the solver 3; what it took before is not theirs.
    player = [noted(Moment.PLAYED, 10.0 * image, 500.0 + image) for image in range(30)]
    solver = [noted(Moment.SOLVED, 10.0 * image + 4.0, 9000.0 + 3.0 * image) for image in range(40)]
    assert cost_of_image([player, solver, []]) == pytest.approx(0.004)
    assert cost_of_image([solver[::-1], player]) == pytest.approx(0.004)
    assert np.isnan(cost_of_image([player[:1], solver]))
