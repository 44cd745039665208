"""Whether pictures are neither dark nor white, and as bright all the time."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.doctor.doctor_settings import DoctorSettings
from bodycam_ros.doctor.finding import Finding, Light, by_limits
from bodycam_ros.doctor.sampled_recording import SampledCamera, SampledRecording
from bodycam_ros.geometry import Array

_CHECK = "exposure"
_SATURATED = 250
_BAD_SHARE = 2.5  # times the share of white that is amber


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
            yield Finding(_CHECK, light, what, "more light, a longer exposure or more gain; is its lens free?", of)
        if light := by_limits(float(np.median(white)), settings.saturated, _BAD_SHARE * settings.saturated):
            what = f"{np.median(white):.0%} of its picture is white"
            yield Finding(_CHECK, light, what, "a shorter exposure or less gain", of)
        if (ratio := level.max() / max(level.min(), 1.0)) > settings.flicker and level.max() > settings.dark:
            what = f"its brightest image is {ratio:.1f} times as bright as its darkest"
            yield Finding(_CHECK, Light.AMBER, what, "fix exposure and gain, or mind windows and lamps", of)
    if levels:
        yield Finding(_CHECK, Light.GREEN, f"middle grey levels {min(levels):.0f} to {max(levels):.0f} of 255")


def _levels(camera: SampledCamera) -> tuple[Array, Array]:
    """(K,) middle grey level and share of white of the images."""
    lit = camera.lit
    pictures = [grey if lit is None else grey[lit > 0] for grey in camera.images.values()]
    return (
        np.array([float(np.median(picture)) for picture in pictures]),
        np.array([float((picture >= _SATURATED).mean()) for picture in pictures]),
    )
