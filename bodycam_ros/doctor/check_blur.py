"""Whether pictures are sharp, by Crete et al. 2007: a blurred picture hardly changes when it is blurred once more."""

from collections.abc import Iterator

import cv2
import numpy as np

from bodycam_ros.doctor.doctor_settings import DoctorSettings
from bodycam_ros.doctor.finding import Finding, by_limits
from bodycam_ros.doctor.sampled_recording import Grey, SampledRecording

_CHECK = "blur"
_WINDOW = 11  # [px] of the blur that a picture is compared with
_WIDTH = 640  # to which wide pictures are brought; the limits are for such
_BAD_SHARE = 3.0  # times the share that is amber


def check_blur(recording: SampledRecording, settings: DoctorSettings) -> Iterator[Finding]:
    """Count the sampled images that are blurred."""
    shares = []
    for camera in recording.cameras:
        if not camera.images:
            continue
        blurs = np.array([blur_of(grey) for grey in camera.images.values()])
        shares.append(float((blurs > settings.blur).mean()))
        if light := by_limits(shares[-1], settings.blurred, _BAD_SHARE * settings.blurred):
            what = f"{shares[-1]:.0%} of its images are blurred"
            remedy = "a shorter exposure (and more light), a tighter strap; is its lens clean and in focus?"
            yield Finding(_CHECK, light, what, remedy, f"camera {camera.name}")
    if shares:
        yield Finding(_CHECK, by_limits(0.0, 1.0, 1.0), f"{np.mean(shares):.0%} of the images are blurred")


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
