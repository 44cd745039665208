"""Whether pictures are sharp, by Crete et al. 2007: a blurred picture hardly changes when it is blurred once more."""

from collections.abc import Iterator

import cv2
import numpy as np

from bodycam_ros.geometry import Array
from bodycam_ros.quality.doctor_settings import DoctorSettings
from bodycam_ros.quality.finding import Finding, Light, by_limits
from bodycam_ros.quality.sampled_recording import Grey, SampledCamera, SampledRecording
from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings

_BLUR = "blur"
_WINDOW = 11  # [px] of the blur that a picture is compared with
_WIDTH = 640  # to which wide pictures are brought; the limits are for such
_BLURRED = 3.0  # times the share that is amber


def check_blur(recording: SampledRecording, settings: DoctorSettings) -> Iterator[Finding]:
    """Count the sampled images that are blurred."""
    shares = []
    for camera in recording.cameras:
        if not camera.images:
            continue
        blurs = np.array([blur_of(grey) for grey in camera.images.values()])
        shares.append(float((blurs > settings.blur).mean()))
        if light := by_limits(shares[-1], settings.blurred, _BLURRED * settings.blurred):
            what = f"{shares[-1]:.0%} of its images are blurred"
            remedy = "a shorter exposure (and more light), a tighter strap; is its lens clean and in focus?"
            yield Finding(_BLUR, light, what, remedy, f"camera {camera.name}")
    if shares:
        yield Finding(_BLUR, Light.GREEN, f"{np.mean(shares):.0%} of the images are blurred")


def blur_of(grey: Grey) -> float:
    """Blur of an image (H, W) in its worst direction: 0 none, 1 all; some 0.34 of a sharp one."""
    if grey.shape[1] > _WIDTH:
        scale = _WIDTH / grey.shape[1]
        grey = np.asarray(cv2.resize(grey, None, fx=scale, fy=scale, interpolation=cv2.INTER_AREA), np.uint8)
    picture = grey.astype(np.float32)
    worst = 0.0
    for axis, window in ((0, (1, _WINDOW)), (1, (_WINDOW, 1))):
        blurred = cv2.blur(picture, window, borderType=cv2.BORDER_REFLECT)
        steps = np.abs(np.diff(picture, axis=axis))
        gone = np.maximum(steps - np.abs(np.diff(blurred, axis=axis)), 0.0)
        total = float(steps.sum())
        worst = max(worst, (total - float(gone.sum())) / total if total else 1.0)
    return worst


_EXPOSURE = "exposure"
_SATURATED = 250
_BADLY_EXPOSED = 2.5  # times the share of white that is amber


def check_exposure(recording: SampledRecording, settings: DoctorSettings) -> Iterator[Finding]:
    """Look at the grey levels of the sampled images, without the black around a fisheye picture."""
    levels = []
    for camera in recording.cameras:
        if not camera.images:
            continue
        level, white = _levels(camera)
        levels.append(float(np.median(level)))
        of = f"camera {camera.name}"
        if light := by_limits(levels[-1], settings.dark, settings.black):
            what = f"is dark: middle grey level {levels[-1]:.0f} of 255"
            yield Finding(_EXPOSURE, light, what, "more light, a longer exposure or more gain; is its lens free?", of)
        if light := by_limits(float(np.median(white)), settings.saturated, _BADLY_EXPOSED * settings.saturated):
            what = f"{np.median(white):.0%} of its picture is white"
            yield Finding(_EXPOSURE, light, what, "a shorter exposure or less gain", of)
        if (ratio := level.max() / max(level.min(), 1.0)) > settings.flicker and level.max() > settings.dark:
            what = f"its brightest image is {ratio:.1f} times as bright as its darkest"
            yield Finding(_EXPOSURE, Light.AMBER, what, "fix exposure and gain, or mind windows and lamps", of)
    if levels:
        yield Finding(_EXPOSURE, Light.GREEN, f"middle grey levels {min(levels):.0f} to {max(levels):.0f} of 255")


def _levels(camera: SampledCamera) -> tuple[Array, Array]:
    """(K,) middle grey level and share of white of the images."""
    lit = camera.lit
    pictures = [grey if lit is None else grey[lit > 0] for grey in camera.images.values()]
    return (
        np.array([float(np.median(picture)) for picture in pictures]),
        np.array([float((picture >= _SATURATED).mean()) for picture in pictures]),
    )


_FEATURES = "features"
_LOOKED_AT = 4  # images of a camera


def check_features(recording: SampledRecording, settings: DoctorSettings) -> Iterator[Finding]:
    """Count the features of some images, as the trackers find them."""
    detector = KeypointDetector(KeypointSettings())
    medians = []
    for camera in recording.cameras:
        chosen = list(camera.images.values())[:: max(1, len(camera.images) // _LOOKED_AT)][:_LOOKED_AT]
        if not chosen:
            continue
        lit = camera.lit
        masks = [np.full_like(grey, 255) if lit is None else lit for grey in chosen]
        counts = [len(detector.detect(grey, mask).pixels) for grey, mask in zip(chosen, masks, strict=True)]
        medians.append(float(np.median(counts)))
        if light := by_limits(medians[-1], settings.features, settings.few_features):
            what = f"{medians[-1]:.0f} features in an image"
            remedy = "turn it away from bare walls and sky, hang up pictures, more light; does clothing cover it?"
            yield Finding(_FEATURES, light, what, remedy, f"camera {camera.name}")
    if medians:
        yield Finding(
            _FEATURES,
            Light.GREEN,
            f"{min(medians):.0f} to {max(medians):.0f} features in an image, as looked for",
        )
