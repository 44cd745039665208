"""How many images find themselves in the map."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.doctor.doctor_settings import DoctorSettings
from bodycam_ros.doctor.finding import Finding, Light, by_limits
from bodycam_ros.doctor.registered_samples import RegisteredSamples

_CHECK = "registered"


def check_registration(registered: RegisteredSamples, settings: DoctorSettings) -> Iterator[Finding]:
    """Say of each camera in how many of the sampled images it knows where it is."""
    shares = {camera: registered.share(camera) for camera in registered.poses}
    shares = {camera: share for camera, share in shares.items() if np.isfinite(share)}
    if not shares:
        yield Finding(_CHECK, Light.RED, "no image could be asked", "see to lenses and images first")
        return
    if not any(shares.values()):
        what = "no camera finds itself in the map"
        remedy = (
            "is it the map of this place? are the lenses those of the cameras? photograph more ('bodycam map check')"
        )
        yield Finding(_CHECK, Light.RED, what, remedy)
        return
    for camera, share in sorted(shares.items()):
        if light := by_limits(share, settings.registered, settings.hardly_registered):
            what = f"finds itself in {share:.0%} of {len(registered.poses[camera])} images"
            remedy = "photograph what it looks at and map that too ('bodycam map extend' takes this recording)"
            yield Finding(_CHECK, light, what, remedy, f"camera {camera}")
    images = sum(len(poses) for poses in registered.poses.values())
    what = (
        f"{np.mean(list(shares.values())):.0%} of {images} single images find themselves; one after the other more do"
    )
    yield Finding(_CHECK, Light.GREEN, what)
