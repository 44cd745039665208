"""Each check on a camera with one thing wrong, beside one with nothing."""

from collections.abc import Callable, Iterable

import cv2
import numpy as np
import pytest
from helpers.naming import names, numbers
from quality.sampled_cameras import DURATION_S, INTERVAL_S, lens, recording, sampled, textured

from bodycam_ros.quality import sampled_recording
from bodycam_ros.quality.recording_checks import (
    IMAGE_CHECKS,
    blur_measure,
    check_cameras,
    check_clocks,
    check_gaps,
    check_lens,
    check_spans,
)
from bodycam_ros.quality.sampled_recording import SampledCamera, SampledRecording
from bodycam_ros.results.verdict import Finding, Level, check_limits, limit_level, worst_level

STAMPS_S = np.arange(0.0, DURATION_S, INTERVAL_S)

Check = Callable[[SampledRecording], Iterable[Finding]]

CHECKS: dict[str, Check] = {
    "cameras": lambda r: check_cameras(r, {"head", "hand", "foot"}),
    "gaps": check_gaps,
    "span": check_spans,
    "clocks": check_clocks,
    "images": lambda r: check_limits({camera.name: camera for camera in r.cameras}, IMAGE_CHECKS),
    "lens": check_lens,
}


def images(picture: np.ndarray) -> dict[int, np.ndarray]:
    return {number: picture for number in range(4)}


def blurred() -> np.ndarray:
    return cv2.GaussianBlur(textured(), (0, 0), 5.0)


def without(start_s: float, stop_s: float) -> np.ndarray:
    return STAMPS_S[(STAMPS_S < start_s) | (STAMPS_S >= stop_s)]


ILL: list[tuple[str, dict[str, object], Level, tuple[str, ...]]] = [
    ("cameras", {"images": {}}, Level.WRONG, ()),
    ("cameras", {"fault": "cannot be decoded"}, Level.WRONG, ("cannot be decoded",)),
    ("images", {"stamps_s": STAMPS_S[:2]}, Level.WRONG, ("0.0",)),
    ("images", {"stamps_s": STAMPS_S[::6]}, Level.DOUBTFUL, ("5.0",)),
    ("gaps", {"stamps_s": without(4.0, 4.5)}, Level.DOUBTFUL, ("0.5 s", "4.0 s")),
    ("gaps", {"stamps_s": without(4.0, 6.0)}, Level.WRONG, ("2.0 s", "4.0 s")),
    ("span", {"stamps_s": without(0.0, 3.0)}, Level.DOUBTFUL, ("7.0 s", "10.0 s")),
    ("span", {"stamps_s": without(4.0, 11.0)}, Level.WRONG, ("4.0 s", "10.0 s")),
    ("images", {"missing": 30}, Level.DOUBTFUL, ("9%",)),
    ("clocks", {"stamps_s": STAMPS_S + 2.0, "recorded_s": STAMPS_S}, Level.WRONG, ("2.00 s", "ahead")),
    ("images", {"stamps_s": 1.001 * STAMPS_S, "recorded_s": STAMPS_S}, Level.DOUBTFUL, ("1000 ppm",)),
    ("images", {"stamps_s": np.sort(STAMPS_S)[::-1], "recorded_s": STAMPS_S}, Level.WRONG, ()),
    ("images", {"images": images(textured(0.15))}, Level.DOUBTFUL, ("dark",)),
    ("images", {"images": images(textured(0.02))}, Level.WRONG, ("dark",)),
    ("images", {"images": images(textured(4.0))}, Level.WRONG, ("white",)),
    ("images", {"images": images(blurred())}, Level.WRONG, ("100%", "blurred")),
    ("images", {"images": {0: blurred(), 1: textured()}}, Level.DOUBTFUL, ("50%", "blurred")),
    ("images", {"images": images(np.full((240, 320), 90, np.uint8))}, Level.WRONG, ("0 features",)),
    ("lens", {"lens": None, "lens_fault": "there is no lens YAML"}, Level.WRONG, ("there is no lens YAML",)),
    ("lens", {"lens": lens(width=640, height=480)}, Level.WRONG, ("320 x 240", "640 x 480")),
]


@pytest.mark.parametrize(("check", "changes", "level", "named"), ILL)
def test_what_is_wrong_is_said_of_the_camera(
    check: str, changes: dict[str, object], level: Level, named: tuple[str, ...]
) -> None:
    found = [
        f for f in CHECKS[check](recording(sampled("foot"), sampled("hand"), sampled("head", **changes))) if f.level
    ]
    assert worst_level(found) is level
    assert any(f.level is level and all(names(f.text, thing) for thing in named) for f in found)
    assert {f.subject for f in found} == {"head"}
    assert all(f.what for f in found)


@pytest.mark.parametrize("check", CHECKS)
def test_what_is_right_is_good(check: str) -> None:
    found = list(CHECKS[check](recording(*map(sampled, ("foot", "hand", "head")))))
    assert found and worst_level(found) is Level.GOOD


def test_cameras_of_the_rig_that_lack_are_named() -> None:
    found = list(check_cameras(recording(sampled("head"), sampled("hand")), {"head", "foot"}))
    assert [(f.subject, f.level) for f in found if f.level] == [("foot", Level.WRONG), ("hand", Level.DOUBTFUL)]


@pytest.mark.parametrize("axis", [0, 1])
def test_blur_grows_with_what_a_picture_is_blurred_by(axis: int) -> None:
    sizes = [(1, 1), (3, 1), (7, 1), (13, 1)]
    blurs = [blur_measure(np.asarray(cv2.blur(textured(), size if axis else size[::-1]))) for size in sizes]
    assert blurs == sorted(blurs)
    assert blurs[-1] - blurs[0] > 0.2


def test_lenses_of_another_size_do_not_count_as_right() -> None:
    found = list(check_lens(recording(sampled("foot"), sampled("head", lens=lens(width=640, height=480)))))
    (good,) = (f for f in found if not f.level)
    assert numbers(good.what) == [1] and names(good.what, "equidistant")


def test_instants_without_images_do_not_make_a_map_hopeless(monkeypatch: pytest.MonkeyPatch) -> None:
    class Found:
        world_T_camera = np.eye(4)

        def register(self, *_: object) -> "Found":
            return self

    monkeypatch.setattr(sampled_recording, "ImageRegistration", lambda *_: Found())
    of = recording(sampled("head", images={3: textured()}))
    advanced: list[int] = []
    registered = sampled_recording.register_samples(
        of,
        ["head"],
        [0, 1, 2, 3],
        None,
        1,
        lambda: advanced.append(1),  # type: ignore[arg-type]
    )
    assert list(registered.known("head")) == [3] and len(advanced) == 1


def test_limits_go_both_ways() -> None:
    assert [limit_level(value, 1.0, 2.0) for value in (0.5, 1.5, 2.5)] == [Level.GOOD, Level.DOUBTFUL, Level.WRONG]
    assert [limit_level(value, 2.0, 1.0) for value in (2.5, 1.5, 0.5)] == [Level.GOOD, Level.DOUBTFUL, Level.WRONG]


def test_a_camera_without_lens_has_no_mask() -> None:
    nobody: SampledCamera = sampled(lens=None)
    assert nobody.lit is None


def test_cameras_that_are_started_by_hand_are_good() -> None:
    """Up to 2.5 s apart, as eight hands would start them; a camera of half a second among them is wrong."""
    cameras = [sampled(f"camera_{n}", stamps_s=STAMPS_S + 2.5 * n / 7.0) for n in range(8)]
    assert worst_level(check_spans(recording(*cameras))) is Level.GOOD
    short = sampled("short", stamps_s=STAMPS_S[STAMPS_S < 0.5] + 4.0)
    for is_synchronous in (True, False):
        found = [f for f in check_spans(recording(*cameras, short, is_synchronous=is_synchronous)) if f.level]
        assert [(f.subject, f.level) for f in found] == [("short", Level.WRONG)]
