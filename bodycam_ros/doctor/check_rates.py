"""Whether images came at a steady rate, from the beginning to the end."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.doctor.doctor_settings import DoctorSettings
from bodycam_ros.doctor.finding import Finding, Light, by_limits
from bodycam_ros.doctor.sampled_recording import SampledCamera, SampledRecording

_RATE, _GAPS = "rate", "gaps"
_FEWEST = 3  # images, of which a rate can be told
_SKIPPED = 2.5  # intervals: an image is missing
_BAD_LOSS = 10.0  # times the share that is amber
_REMEDY = "a faster card, a shorter cable, fewer pixels or images a second; then record again"


def check_rates(recording: SampledRecording, settings: DoctorSettings) -> Iterator[Finding]:
    """Say which cameras are slow, have gaps, begin late or end early."""
    usable = [camera for camera in recording.cameras if len(camera.stamps_s) >= _FEWEST]
    for camera in recording.cameras:
        if camera not in usable:
            what = f"{len(camera.stamps_s)} images in {recording.duration_s:.1f} s"
            yield Finding(
                _RATE, Light.RED, what, "it did not record; look at it and record again", f"camera {camera.name}"
            )
    for camera in usable:
        yield from _rate(camera, settings)
        yield from _gaps(camera, settings)
        yield from _losses(camera, settings)
        if recording.is_synchronous:
            yield from _ends(camera, recording, settings)
    if usable:
        rates = [1.0 / camera.interval_s for camera in usable]
        yield Finding(_RATE, Light.GREEN, f"{min(rates):.1f} to {max(rates):.1f} images a second")
        longest = max(float(np.diff(np.sort(camera.stamps_s)).max()) for camera in usable)
        yield Finding(_GAPS, Light.GREEN, f"longest time without an image {longest:.2f} s")


def _rate(camera: SampledCamera, settings: DoctorSettings) -> Iterator[Finding]:
    rate_hz = 1.0 / camera.interval_s
    if rate_hz < settings.low_rate:
        what = f"{rate_hz:.1f} images a second"
        yield Finding(_RATE, Light.AMBER, what, f"set it to {settings.low_rate:g} or more", f"camera {camera.name}")


def _gaps(camera: SampledCamera, settings: DoctorSettings) -> Iterator[Finding]:
    stamps_s = np.sort(camera.stamps_s)
    steps_s = np.diff(stamps_s)
    long = (steps_s > settings.gap) & (steps_s > _SKIPPED * camera.interval_s)
    if long.any():
        worst = int(np.argmax(steps_s))
        what = (
            f"{long.sum()} times without an image for more than {settings.gap:g} s, {steps_s[worst]:.1f} s at "
            f"{stamps_s[worst]:.1f} s"
        )
        light = Light.RED if steps_s[worst] > settings.long_gap else Light.AMBER
        yield Finding(_GAPS, light, what, _REMEDY, f"camera {camera.name}")


def _losses(camera: SampledCamera, settings: DoctorSettings) -> Iterator[Finding]:
    steps_s = np.diff(np.sort(camera.stamps_s))
    skipped = np.where(steps_s > _SKIPPED * camera.interval_s, np.round(steps_s / camera.interval_s) - 1.0, 0.0)
    lost = camera.missing + float(skipped.sum())
    share = lost / (lost + len(camera.stamps_s))
    if light := by_limits(share, settings.lost, _BAD_LOSS * settings.lost):
        yield Finding(_GAPS, light, f"{share:.0%} of its images are missing", _REMEDY, f"camera {camera.name}")


def _ends(camera: SampledCamera, recording: SampledRecording, settings: DoctorSettings) -> Iterator[Finding]:
    late_s = float(camera.recorded_s.min())
    early_s = recording.duration_s - float(camera.recorded_s.max())
    for missing_s, when in ((late_s, "begins {:.1f} s late"), (early_s, "ends {:.1f} s early")):
        if missing_s > settings.long_gap:
            light = Light.RED if missing_s > 0.5 * recording.duration_s else Light.AMBER
            what = when.format(missing_s)
            yield Finding(
                _GAPS, light, what, "battery, card or cable? its limb is guessed then", f"camera {camera.name}"
            )
