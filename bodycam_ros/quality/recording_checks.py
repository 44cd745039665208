"""Checks of a recording without a map: cameras, frame rates, clocks, lenses and images."""

from collections.abc import Collection, Iterator

import cv2
import numpy as np

from bodycam_ros.camera.model import mode_of_size
from bodycam_ros.geometry import Array
from bodycam_ros.quality.sampled_recording import Grey, SampledCamera, SampledRecording
from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings
from bodycam_ros.verdict import Finding, Level, limit_level


def good(check: str, what: str) -> Finding:
    """The finding of a check of the whole recording that found nothing wrong."""
    return Finding("", Level.GOOD, what, part="recording", check=check)


def check_cameras(recording: SampledRecording, wanted: Collection[str] | None) -> Iterator[Finding]:
    """Compare the cameras of a recording with those of a rig or body, and find images that cannot be decoded.

    Args:
        recording: samples.
        wanted: cameras of the rig or body; None without either.
    """
    check = "cameras"
    present = {camera.name for camera in recording.cameras}
    for reason in recording.left_out:
        yield Finding("", Level.WRONG, reason, part="recording", check=check)
    for name in sorted(set(wanted or ()) - present):
        remedy = "was it switched on? record again with it, or take it out of the rig"
        yield Finding(name, Level.WRONG, "is not in the recording", remedy=remedy, check=check)
    for name in sorted(present - set(wanted)) if wanted is not None else ():
        what, remedy = "is not in the rig or body", "it will be left out; is its name spelt as in the rig?"
        yield Finding(name, Level.DOUBTFUL, what, remedy=remedy, check=check)
    for camera in recording.cameras:
        if camera.fault:
            yield Finding(camera.name, Level.WRONG, camera.fault.removeprefix(f"camera {camera.name}: "), check=check)
        elif not camera.images:
            what, remedy = "none of the sampled images is in the recording", "look at its recording; record again"
            yield Finding(camera.name, Level.WRONG, what, remedy=remedy, check=check)
    sizes = {f"{grey.shape[1]} x {grey.shape[0]}" for camera in recording.cameras for grey in camera.images.values()}
    yield good(
        check, f"{len(present)} cameras, {recording.duration_s:.1f} s, {' and '.join(sorted(sizes)) or 'no image'}"
    )


_MIN_RATE_IMAGES = 3  # images of which a rate can be computed
_MIN_RATE_HZ = 10.0  # a walk was solved as well at 10 as at 30; below it limbs turn too far in between
_GAP_S = 0.2  # limbs are interpolated for as long, fast ones wrong by 10 deg
_LONG_GAP_S = 1.0  # a limb may do anything in this time
_SKIPPED_INTERVALS = 2.5  # from here on an image is missing
_LOST_SHARE, _MANY_LOST = 0.02, 0.2  # of the images; a card or disk that is too slow
_SLOW_STORAGE = "a faster card, a shorter cable, fewer pixels or images a second; then record again"


def check_rates(recording: SampledRecording) -> Iterator[Finding]:
    """Find cameras that are slow, have gaps, start late or end early."""
    usable = [camera for camera in recording.cameras if len(camera.stamps_s) >= _MIN_RATE_IMAGES]
    for camera in recording.cameras:
        if camera not in usable:
            what = f"{len(camera.stamps_s)} images in {recording.duration_s:.1f} s"
            remedy = "it did not record; look at it and record again"
            yield Finding(camera.name, Level.WRONG, what, remedy=remedy, check="rate")
    for camera in usable:
        if (rate_hz := 1.0 / camera.interval_s) < _MIN_RATE_HZ:
            what, remedy = f"{rate_hz:.1f} images a second", f"set it to {_MIN_RATE_HZ:g} or more"
            yield Finding(camera.name, Level.DOUBTFUL, what, remedy=remedy, check="rate")
        yield from _check_gaps(camera)
        if recording.is_synchronous:
            yield from _check_ends(camera, recording.duration_s)
    if usable:
        rates = [1.0 / camera.interval_s for camera in usable]
        yield good("rate", f"{min(rates):.1f} to {max(rates):.1f} images a second")
        longest = max(float(np.diff(np.sort(camera.stamps_s)).max()) for camera in usable)
        yield good("gaps", f"longest time without an image {longest:.2f} s")


def _check_gaps(camera: SampledCamera) -> Iterator[Finding]:
    stamps_s = np.sort(camera.stamps_s)
    steps_s = np.diff(stamps_s)
    is_gap = steps_s > _SKIPPED_INTERVALS * camera.interval_s
    if count := int((is_gap & (steps_s > _GAP_S)).sum()):
        worst = int(np.argmax(steps_s))
        what = (
            f"{count} times without an image for more than {_GAP_S:g} s, {steps_s[worst]:.1f} s at "
            f"{stamps_s[worst]:.1f} s"
        )
        level = Level.WRONG if steps_s[worst] > _LONG_GAP_S else Level.DOUBTFUL
        yield Finding(camera.name, level, what, remedy=_SLOW_STORAGE, check="gaps")
    lost = camera.missing + float((np.round(steps_s / camera.interval_s) - 1.0)[is_gap].sum())
    share = lost / (lost + len(camera.stamps_s))
    if level := limit_level(share, _LOST_SHARE, _MANY_LOST):
        yield Finding(camera.name, level, f"{share:.0%} of its images are missing", remedy=_SLOW_STORAGE, check="gaps")


def _check_ends(camera: SampledCamera, duration_s: float) -> Iterator[Finding]:
    late_s, early_s = float(camera.recorded_s.min()), duration_s - float(camera.recorded_s.max())
    for missing_s, what in ((late_s, f"begins {late_s:.1f} s late"), (early_s, f"ends {early_s:.1f} s early")):
        if missing_s > _LONG_GAP_S:
            level = Level.WRONG if missing_s > 0.5 * duration_s else Level.DOUBTFUL
            remedy = "battery, card or cable? its segment is predicted in that time"
            yield Finding(camera.name, level, what, remedy=remedy, check="gaps")


_MAX_CLOCK_OFFSET_S = 0.5  # to the other cameras; smaller offsets are estimated from the motion of the body
_MAX_DRIFT_PPM = 300.0  # clocks of cameras drift by 10 to 100; more are stamps that jump
_MANY_BACKWARDS = 0.05  # share of the stamps
_MIN_DRIFT_IMAGES, _MIN_DRIFT_S = 30, 5.0  # of which a drift can be computed


def check_clocks(recording: SampledRecording) -> Iterator[Finding]:
    """Compare stamps with the times of recording; of videos, find those without sound to synchronise by."""
    check = "clocks"
    if not recording.is_synchronous:
        yield from _check_sound(recording)
        return
    ahead_s = {c.name: float(np.median(c.stamps_s - c.recorded_s)) for c in recording.cameras if len(c.stamps_s)}
    usual_s = float(np.median(list(ahead_s.values()))) if ahead_s else 0.0
    for camera in recording.cameras:
        backwards = float((np.diff(camera.stamps_s) <= 0.0).mean()) if len(camera.stamps_s) > 1 else 0.0
        if level := limit_level(backwards, 0.0, _MANY_BACKWARDS):
            what = f"{backwards:.1%} of its stamps are not after the one before"
            remedy = "these images are left out; stamp images when they are taken"
            yield Finding(camera.name, level, what, remedy=remedy, check=check)
        off_s = ahead_s.get(camera.name, usual_s) - usual_s
        if abs(off_s) > _MAX_CLOCK_OFFSET_S:
            what = f"its stamps are {abs(off_s):.2f} s {'ahead of' if off_s > 0 else 'behind'} those of the others"
            remedy = "set all clocks by one (NTP, PTP), then record again"
            yield Finding(camera.name, Level.WRONG, what, remedy=remedy, check=check)
        drift = _drift_ppm(camera.recorded_s, camera.stamps_s)
        if abs(drift) > _MAX_DRIFT_PPM:
            what = f"its stamps go {abs(drift):.0f} ppm too {'fast' if drift > 0 else 'slow'}"
            remedy = "drifts of some 100 ppm are estimated from motion, not more"
            yield Finding(camera.name, Level.DOUBTFUL, what, remedy=remedy, check=check)
    apart_ms = 1e3 * max((abs(ahead - usual_s) for ahead in ahead_s.values()), default=0.0)
    yield good(check, f"stamps and times of recording {apart_ms:.0f} ms apart at most, from camera to camera")


def _check_sound(recording: SampledRecording) -> Iterator[Finding]:
    silent = [camera.name for camera in recording.cameras if not camera.has_sound]
    for name in silent:
        what, remedy = "has no sound, so no clap gives its clock", "switch its sound on, or rely on its motion"
        yield Finding(name, Level.DOUBTFUL, what, remedy=remedy, check="clocks")
    if count := len(recording.cameras) - len(silent):
        yield good("clocks", f"{count} videos with sound; 'bodycam ingest' synchronises them")


def _drift_ppm(recorded_s: Array, stamps_s: Array) -> float:
    """Drift of stamps against the recorder's clock; 0 where it cannot be computed."""
    if len(stamps_s) < _MIN_DRIFT_IMAGES or np.ptp(recorded_s) < _MIN_DRIFT_S:
        return 0.0
    half = len(stamps_s) // 2
    # Medians of halves: transport delays single images, never the clock.
    ahead = stamps_s - recorded_s
    later_s = float(np.median(recorded_s[half:]) - np.median(recorded_s[:half]))
    return 1e6 * float(np.median(ahead[half:]) - np.median(ahead[:half])) / later_s


_MAX_OFF_CENTRE = 0.25  # of the picture, by which a principal point is off; beyond it the picture was cropped


def check_lens(recording: SampledRecording) -> Iterator[Finding]:
    """Compare the sizes of images with those of their calibrations."""
    check = "lens"
    models = []
    for camera in recording.cameras:
        lens = camera.lens
        if lens is None:
            fault = camera.lens_fault.removeprefix(f"camera {camera.name}: ")
            yield Finding(camera.name, Level.WRONG, fault, check=check)
            continue
        sizes = {(grey.shape[1], grey.shape[0]) for grey in camera.images.values()} - {(lens.width, lens.height)}
        for width, height in sorted(sizes):
            what = f"its images have {width} x {height} px, its lens is for {lens.width} x {lens.height}"
            remedy = mode_of_size((lens.width, lens.height), (width, height))
            yield Finding(camera.name, Level.WRONG, what, remedy=remedy, check=check)
        off = max(abs(lens.cx / lens.width - 0.5), abs(lens.cy / lens.height - 0.5))
        if off > _MAX_OFF_CENTRE:
            what = f"its principal point is {off:.0%} of the picture off the middle"
            remedy = "was the picture cropped after the calibration?"
            yield Finding(camera.name, Level.DOUBTFUL, what, remedy=remedy, check=check)
        if not sizes:
            models.append(lens.distortion_model)
    if models:
        yield good(check, f"{len(models)} lenses ({', '.join(sorted(set(models)))}) for images of their size")


_DARK, _BLACK = 30.0, 8.0  # median grey level; noise hides landmarks, the lens is covered
_WHITE_LEVEL = 250  # grey level of a saturated pixel
_WHITE_SHARE, _MOSTLY_WHITE = 0.2, 0.5  # of a picture
_MAX_FLICKER = 3.0  # brightest to darkest image: exposure hunts


def check_exposure(recording: SampledRecording) -> Iterator[Finding]:
    """Check the grey levels of the sampled images, without the black around a fisheye picture."""
    check = "exposure"
    medians = []
    for camera in recording.cameras:
        if not camera.images:
            continue
        lit = None if camera.lit is None else camera.lit > 0
        pictures = [grey if lit is None else grey[lit] for grey in camera.images.values()]
        levels = np.array([float(np.median(picture)) for picture in pictures])
        white = float(np.median([(picture >= _WHITE_LEVEL).mean() for picture in pictures]))
        medians.append(float(np.median(levels)))
        if level := limit_level(medians[-1], _DARK, _BLACK):
            what = f"is dark: median grey level {medians[-1]:.0f} of 255"
            remedy = "more light, a longer exposure or more gain; is its lens free?"
            yield Finding(camera.name, level, what, remedy=remedy, check=check)
        if level := limit_level(white, _WHITE_SHARE, _MOSTLY_WHITE):
            what, remedy = f"{white:.0%} of its picture is white", "a shorter exposure or less gain"
            yield Finding(camera.name, level, what, remedy=remedy, check=check)
        if (ratio := levels.max() / max(levels.min(), 1.0)) > _MAX_FLICKER and levels.max() > _DARK:
            what = f"its brightest image is {ratio:.1f} times as bright as its darkest"
            remedy = "fix exposure and gain, or mind windows and lamps"
            yield Finding(camera.name, Level.DOUBTFUL, what, remedy=remedy, check=check)
    if medians:
        yield good(check, f"median grey levels {min(medians):.0f} to {max(medians):.0f}")


_BLURRED = 0.55  # Crete's blur: sharp images have 0.34, blurred by 5 px 0.49, by 8 px 0.59 with features off by cm
_BLURRED_SHARE, _MOSTLY_BLURRED = 0.25, 0.75  # of the images
_BLUR_WINDOW_PX = 11  # of the blur that a picture is compared with
_BLUR_WIDTH_PX = 640  # that wider pictures are reduced to; the limit is for such


def check_blur(recording: SampledRecording) -> Iterator[Finding]:
    """Count the sampled images that are blurred."""
    shares = []
    for camera in recording.cameras:
        if not camera.images:
            continue
        shares.append(float(np.mean([blur_measure(grey) > _BLURRED for grey in camera.images.values()])))
        if level := limit_level(shares[-1], _BLURRED_SHARE, _MOSTLY_BLURRED):
            what = f"{shares[-1]:.0%} of its images are blurred"
            remedy = "a shorter exposure (and more light), a tighter strap; is its lens clean and in focus?"
            yield Finding(camera.name, level, what, remedy=remedy, check="blur")
    if shares:
        yield good("blur", f"{np.mean(shares):.0%} of the images are blurred")


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


_MANY_FEATURES, _FEW_FEATURES = 150, 40  # of an image; a quarter are landmarks, a hundred of which fix a pose well
_FEATURE_IMAGES = 4  # of a camera


def check_features(recording: SampledRecording) -> Iterator[Finding]:
    """Count the features of some images, detected as for tracking."""
    detector = KeypointDetector(KeypointSettings())
    medians = []
    for camera in recording.cameras:
        chosen = list(camera.images.values())[:: max(1, len(camera.images) // _FEATURE_IMAGES)][:_FEATURE_IMAGES]
        if not chosen:
            continue
        masks = [np.full_like(grey, 255) if camera.lit is None else camera.lit for grey in chosen]
        counts = [len(detector.detect(grey, mask).pixels) for grey, mask in zip(chosen, masks, strict=True)]
        medians.append(float(np.median(counts)))
        if level := limit_level(medians[-1], _MANY_FEATURES, _FEW_FEATURES):
            remedy = "turn it away from bare walls and sky, hang up pictures, more light; does clothing cover it?"
            what = f"{medians[-1]:.0f} features in an image"
            yield Finding(camera.name, level, what, remedy=remedy, check="features")
    if medians:
        yield good("features", f"{min(medians):.0f} to {max(medians):.0f} features in an image")
