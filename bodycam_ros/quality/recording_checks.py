"""Checks of a recording without a map: cameras, frame rates, clocks, lenses and images."""

from collections.abc import Callable, Collection, Iterator
from functools import partial

import cv2
import numpy as np

from bodycam_ros.calibration.rig import NOT_RECORDED
from bodycam_ros.camera.model import size_mismatch
from bodycam_ros.ingest.camera_remarks import left_out
from bodycam_ros.quality.sampled_recording import Grey, SampledCamera, SampledRecording
from bodycam_ros.recording.time_span import most_cameras_window
from bodycam_ros.results.verdict import Finding, Level, LimitCheck, good, limit_level
from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings


def check_cameras(recording: SampledRecording, wanted: Collection[str] | None) -> Iterator[Finding]:
    """Compare the cameras of a recording with those of a rig or body, and find images that cannot be decoded.

    Args:
        recording: samples.
        wanted: cameras of the rig or body; None without either.
    """
    check = "cameras"
    present = {camera.name for camera in recording.cameras}
    for name, why in recording.left_out.items():
        yield Finding(name, Level.WRONG, left_out(why), check=check)
    for name in sorted(set(wanted or ()) - present):
        yield Finding(name, Level.WRONG, NOT_RECORDED, check=check)
    for name in sorted(present - set(wanted)) if wanted is not None else ():
        what, remedy = "is not in the rig or body", "it will not be used; check its name in the rig"
        yield Finding(name, Level.DOUBTFUL, what, remedy=remedy, check=check)
    for camera in recording.cameras:
        if camera.fault:
            yield Finding(camera.name, Level.WRONG, camera.fault, check=check)
        elif not camera.images:
            what, remedy = "none of the sampled images is in the recording", "look at its recording; record again"
            yield Finding(camera.name, Level.WRONG, what, remedy=remedy, check=check)
    sizes = {f"{grey.shape[1]} x {grey.shape[0]}" for camera in recording.cameras for grey in camera.images.values()}
    what = f"{len(present)} cameras, {recording.duration_s:.1f} s, {' and '.join(sorted(sizes)) or 'no image'}"
    yield good(check, what)


_MIN_RATE_IMAGES = 3  # images of which a rate can be computed
_GAP_S = 0.2  # limbs are interpolated for as long, fast ones wrong by 10 deg
_LONG_GAP_S = 1.0  # a limb may do anything in this time
_SKIPPED_INTERVALS = 2.5  # from here on an image is missing
_SLOW_STORAGE = "use a faster card, a shorter cable, smaller images or a lower rate, then record again"


def check_gaps(recording: SampledRecording) -> Iterator[Finding]:
    """Find times without images."""
    longest_s = []
    for camera in recording.cameras:
        if len(camera.stamps_s) < _MIN_RATE_IMAGES:
            continue
        stamps_s = np.sort(camera.stamps_s)
        steps_s = np.diff(stamps_s)
        worst = int(np.argmax(steps_s))
        longest_s.append(float(steps_s[worst]))
        if count := int((steps_s > max(_SKIPPED_INTERVALS * camera.interval_s, _GAP_S)).sum()):
            times = f"{count} times without an image for more than {_GAP_S:g} s"
            what = f"{times}, {longest_s[-1]:.1f} s at {stamps_s[worst]:.1f} s"
            level = Level.WRONG if longest_s[-1] > _LONG_GAP_S else Level.DOUBTFUL
            yield Finding(camera.name, level, what, remedy=_SLOW_STORAGE, check="gaps")
    if longest_s:
        yield good("gaps", f"longest time without an image {max(longest_s):.2f} s")


_SHORT, _HARDLY_ANY = 0.75, 0.5  # shares of the time in which most cameras run; below them a camera is of little use


def check_spans(recording: SampledRecording) -> Iterator[Finding]:
    """Find cameras that run for a part of the time in which most others do; starting them by hand is no fault.

    Videos have no common time yet: their lengths are compared.
    """
    spans_ns = {
        camera.name: (round(1e9 * camera.recorded_s.min()), round(1e9 * camera.recorded_s.max()))
        for camera in recording.cameras
        if len(camera.recorded_s)
    }
    if len(spans_ns) < 2:
        return
    if not recording.is_synchronous:
        spans_ns = {name: (0, last_ns - first_ns) for name, (first_ns, last_ns) in spans_ns.items()}
    start_ns, end_ns = most_cameras_window(spans_ns)
    whole_s = 1e-9 * (end_ns - start_ns)
    for name, (first_ns, last_ns) in spans_ns.items():
        shared_s = max(0.0, 1e-9 * (min(last_ns, end_ns) - max(first_ns, start_ns)))
        if level := limit_level(shared_s / max(whole_s, 1e-9), _SHORT, _HARDLY_ANY):
            what = f"runs for {shared_s:.1f} s of the {whole_s:.1f} s in which most cameras run"
            remedy = "check its battery, card and cable; its segment is predicted for the rest of the time"
            yield Finding(name, level, what, remedy=remedy, check="span")
    yield good("span", f"three quarters of the cameras run together for {whole_s:.1f} s")


_MAX_CLOCK_OFFSET_S = 0.5  # to the other cameras; smaller offsets are estimated from the motion of the body


def check_clocks(recording: SampledRecording) -> Iterator[Finding]:
    """Compare stamps with the times of recording; videos have no common time to compare, see ``check_videos``."""
    check = "clocks"
    if not recording.is_synchronous:
        return
    ahead_s = {c.name: float(np.median(c.stamps_s - c.recorded_s)) for c in recording.cameras if len(c.stamps_s)}
    usual_s = float(np.median(list(ahead_s.values()))) if ahead_s else 0.0
    off_s = {camera: each - usual_s for camera, each in ahead_s.items()}
    for camera, each in off_s.items():
        if abs(each) > _MAX_CLOCK_OFFSET_S:
            what = f"its stamps are {abs(each):.2f} s {'ahead of' if each > 0 else 'behind'} those of the others"
            remedy = "synchronise all clocks (NTP or PTP), then record again"
            yield Finding(camera, Level.WRONG, what, remedy=remedy, check=check)
    apart_ms = 1e3 * max(map(abs, off_s.values()), default=0.0)
    yield good(check, f"clock offsets between cameras: {apart_ms:.0f} ms at most (stamps against times of recording)")


def check_lens(recording: SampledRecording) -> Iterator[Finding]:
    """Compare the sizes of images with those of their calibrations."""
    models = []
    for camera in recording.cameras:
        lens = camera.lens
        if lens is None:
            yield Finding(camera.name, Level.WRONG, camera.lens_fault, check="lens")
            continue
        sizes = {(grey.shape[1], grey.shape[0]) for grey in camera.images.values()} - {(lens.width, lens.height)}
        for size in sorted(sizes):
            what = size_mismatch((lens.width, lens.height), size)
            yield Finding(camera.name, Level.WRONG, what, check="lens")
        if not sizes:
            models.append(lens.distortion_model)
    if models:
        yield good("lens", f"{len(models)} lenses ({', '.join(sorted(set(models)))}) fit the size of their images")


def _rate_hz(camera: SampledCamera) -> float:
    return 1.0 / camera.interval_s if len(camera.stamps_s) >= _MIN_RATE_IMAGES else 0.0


def _missing_share(camera: SampledCamera) -> float:
    """Share of the images that are missing: declared and not held, or left out between others."""
    if len(camera.stamps_s) < _MIN_RATE_IMAGES:
        return np.nan
    intervals = np.diff(np.sort(camera.stamps_s)) / camera.interval_s
    lost = camera.missing + float((np.round(intervals) - 1.0)[intervals > _SKIPPED_INTERVALS].sum())
    return lost / (lost + len(camera.stamps_s))


def _backwards_share(camera: SampledCamera) -> float:
    return float((np.diff(camera.stamps_s) <= 0.0).mean()) if len(camera.stamps_s) > 1 else 0.0


_MIN_DRIFT_IMAGES, _MIN_DRIFT_S = 30, 5.0  # of which a drift can be computed


def _drift_ppm(camera: SampledCamera) -> float:
    """Size of the drift of stamps against the recorder's clock; 0 where it cannot be computed."""
    recorded_s, ahead_s = camera.recorded_s, camera.stamps_s - camera.recorded_s
    if len(ahead_s) < _MIN_DRIFT_IMAGES or np.ptp(recorded_s) < _MIN_DRIFT_S:
        return 0.0
    # Medians of halves: transport delays single images, never the clock.
    later_s, later_ahead_s = (
        float(np.median(each[len(each) // 2 :]) - np.median(each[: len(each) // 2])) for each in (recorded_s, ahead_s)
    )
    return 1e6 * abs(later_ahead_s) / later_s


_WHITE_LEVEL = 250  # grey level of a saturated pixel


def _of_lit_pixels(statistic: Callable[[Grey], np.floating], camera: SampledCamera) -> float:
    """Median over the sampled images, without the black around a fisheye picture; NaN without any."""
    lit = (grey if camera.lit is None else grey[camera.lit > 0] for grey in camera.images.values())
    return float(np.median([statistic(pixels) for pixels in lit])) if camera.images else np.nan


_brightness = partial(_of_lit_pixels, np.median)
_white_share = partial(_of_lit_pixels, lambda pixels: np.mean(pixels >= _WHITE_LEVEL))


_BLURRED = 0.55  # Crete's blur: sharp images have 0.34, blurred by 5 px 0.49, by 8 px 0.59 with features off by cm
_BLUR_WINDOW_PX = 11  # of the blur that a picture is compared with
_BLUR_WIDTH_PX = 640  # that wider pictures are reduced to; the limit is for such


def _blurred_share(camera: SampledCamera) -> float:
    return float(np.mean([blur_measure(g) > _BLURRED for g in camera.images.values()])) if camera.images else np.nan


def blur_measure(grey: Grey) -> float:
    """Blur of an image (H, W) in its worst direction, 0 to 1, by Crete et al. 2007.

    A blurred picture hardly changes when it is blurred once more.
    """
    if grey.shape[1] > _BLUR_WIDTH_PX:
        scale = _BLUR_WIDTH_PX / grey.shape[1]
        grey = np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
    picture = grey.astype(np.float32)
    worst = 0.0
    for axis, window in ((0, (1, _BLUR_WINDOW_PX)), (1, (_BLUR_WINDOW_PX, 1))):
        blurred = cv2.blur(picture, window, borderType=cv2.BORDER_REFLECT)
        steps = np.abs(np.diff(picture, axis=axis))
        gone = np.maximum(steps - np.abs(np.diff(blurred, axis=axis)), 0.0)
        total = float(steps.sum())
        worst = max(worst, (total - float(gone.sum())) / total if total else 1.0)
    return worst


_FEATURE_IMAGES = 4  # of a camera


def _feature_count(camera: SampledCamera) -> float:
    """Features of an image, detected as for tracking: the median of some images."""
    detector = KeypointDetector(KeypointSettings())
    chosen = list(camera.images.values())[:: max(1, len(camera.images) // _FEATURE_IMAGES)][:_FEATURE_IMAGES]
    masks = [np.full_like(grey, 255) if camera.lit is None else camera.lit for grey in chosen]
    counts = [len(detector.detect(grey, mask).pixels) for grey, mask in zip(chosen, masks, strict=True)]
    return float(np.median(counts)) if counts else np.nan


IMAGE_CHECKS: tuple[LimitCheck[SampledCamera], ...] = (
    # A walk was solved as well at 10 Hz as at 30; below it limbs turn too far in between.
    LimitCheck(
        "rate", _rate_hz, 10.0, 1.0, "{:.1f} images a second", "set its rate to 10 Hz or more, and check its file",
        "{:.1f} to {:.1f} images a second",
    ),
    LimitCheck("gaps", _missing_share, 0.02, 0.2, "{:.0%} of its images are missing", _SLOW_STORAGE),
    LimitCheck(
        "clocks", _backwards_share, 0.0, 0.05, "{:.1%} of its stamps do not increase",
        "these images are not used; set its driver to stamp each image when it is taken",
    ),
    # Clocks of cameras drift by 10 to 100 ppm; more are stamps that jump.
    LimitCheck(
        "clocks", _drift_ppm, 300.0, np.inf, "its stamps drift by {:.0f} ppm",
        "only drifts of some 100 ppm are estimated from the motion; check how its images are stamped",
    ),
    # Noise hides landmarks below 30; below 8 the lens is covered.
    LimitCheck(
        "exposure", _brightness, 30.0, 8.0, "is dark: median grey level {:.0f} of 255",
        "use more light, a longer exposure or more gain; check that its lens is free",
        "median grey levels {:.0f} to {:.0f}",
    ),
    LimitCheck(
        "exposure", _white_share, 0.2, 0.5, "{:.0%} of its picture is white", "use a shorter exposure or less gain"
    ),
    LimitCheck(
        "blur", _blurred_share, 0.25, 0.75, "{:.0%} of its images are blurred",
        "use a shorter exposure (and more light) or a tighter strap; check that its lens is clean and in focus",
        "{:.0%} to {:.0%} of a camera's images are blurred",
    ),
    # A quarter are landmarks, a hundred of which fix a pose well.
    LimitCheck(
        "features", _feature_count, 150.0, 40.0, "{:.0f} features in an image",
        "turn it away from bare walls and sky, hang up pictures or add light; check that no clothing covers it",
        "{:.0f} to {:.0f} features in an image",
    ),
)  # fmt: skip
"""Numbers of a camera's samples, and their limits."""
