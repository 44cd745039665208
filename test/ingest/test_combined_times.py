import numpy as np
import pytest

from bodycam_ros.ingest.camera_time import CameraTime
from bodycam_ros.ingest.combined_times import agree, combined, in_time_of, relative_to


def clock(camera: str, start_s: float, drift: float = 0.0, sigma_s: float = 1e-3) -> CameraTime:
    return CameraTime(camera, start_s, drift, sigma_s, 1e-5, "claps")


REFERENCE = CameraTime("a", 0.0, 0.0, 0.0, 0.0, "claps")


def test_the_surer_of_two_has_more_weight() -> None:
    both = combined(clock("b", 1.0, sigma_s=1e-3), clock("b", 1.001, sigma_s=0.5e-3))
    assert both.start_s == pytest.approx(1.0008)
    assert both.start_sigma_s == pytest.approx(1e-3 / np.sqrt(5.0))
    assert combined(REFERENCE, clock("a", 0.002)) == REFERENCE


def test_who_may_both_be_right() -> None:
    assert agree(clock("b", 1.0), clock("b", 1.004), 10.0)
    assert not agree(clock("b", 1.0), clock("b", 1.01), 10.0)
    assert agree(clock("b", 1.0), clock("b", 1.01), 1000.0)  # drift is not known that well
    assert not agree(clock("b", 1.0), clock("b", 1.0, drift=200e-6), 1000.0)


def test_a_source_with_a_time_of_its_own_is_moved_to_the_reference() -> None:
    own = {"a": clock("a", 7.0, 1e-5), "b": clock("b", 8.5, 1e-5), "c": clock("c", 9.0, 3e-5)}
    moved = in_time_of(own, {"a": REFERENCE, "b": clock("b", 1.6)})
    assert moved["a"].start_s == pytest.approx(0.0, abs=1e-9)
    assert moved["b"].start_s == pytest.approx(1.5, abs=1e-4)
    assert moved["c"].drift == pytest.approx(2e-5)


def test_another_reference_changes_no_two_cameras_against_each_other() -> None:
    times = {"a": REFERENCE, "b": clock("b", 2.0, 40e-6), "c": clock("c", -1.0, -20e-6)}
    moved = relative_to("b", times)
    media_s = np.linspace(0.0, 100.0, 5)
    assert moved["b"].recording_s(media_s) == pytest.approx(media_s)
    for name in "ac":
        # The media time of b at which the same happens, by either.
        before = (times[name].recording_s(media_s) - 2.0) / (1.0 + 40e-6)
        assert moved[name].recording_s(media_s) == pytest.approx(before, abs=1e-9)
        assert moved[name].start_sigma_s >= 1e-3
