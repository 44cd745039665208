"""Whether pictures show enough that can be recognised."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.doctor.doctor_settings import DoctorSettings
from bodycam_ros.doctor.finding import Finding, Light, by_limits
from bodycam_ros.doctor.sampled_recording import SampledRecording
from bodycam_ros.tracking.keypoints import KeypointDetector, KeypointSettings

_CHECK = "features"
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
            yield Finding(_CHECK, light, what, remedy, f"camera {camera.name}")
    if medians:
        yield Finding(
            _CHECK, Light.GREEN, f"{min(medians):.0f} to {max(medians):.0f} features in an image, as looked for"
        )
