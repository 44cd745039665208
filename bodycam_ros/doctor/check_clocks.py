"""Whether stamps go on, and whether those of all cameras are of one time."""

from collections.abc import Iterator

import numpy as np

from bodycam_ros.doctor.doctor_settings import DoctorSettings
from bodycam_ros.doctor.finding import Finding, Light
from bodycam_ros.doctor.sampled_recording import SampledRecording

_CHECK = "clocks"
_FEWEST = 30  # images, of which a drift can be told
_LONG_S = 5.0  # that they must span
_BACKWARDS = 0.05  # share of stamps that is red


def check_clocks(recording: SampledRecording, settings: DoctorSettings) -> Iterator[Finding]:
    """Compare stamps with when they were recorded; of videos, say whether sound can bring them together."""
    if not recording.is_synchronous:
        yield from _by_sound(recording)
        return
    ahead_s = {
        camera.name: float(np.median(camera.stamps_s - camera.recorded_s))
        for camera in recording.cameras
        if len(camera.stamps_s)
    }
    usual_s = float(np.median(list(ahead_s.values()))) if ahead_s else 0.0
    for camera in recording.cameras:
        of = f"camera {camera.name}"
        if (share := float((np.diff(camera.stamps_s) <= 0.0).mean()) if len(camera.stamps_s) > 1 else 0.0) > 0.0:
            light = Light.RED if share > _BACKWARDS else Light.AMBER
            what = f"{share:.1%} of its stamps are not after the one before"
            yield Finding(_CHECK, light, what, "these images are left out; stamp images when they are taken", of)
        off_s = ahead_s.get(camera.name, usual_s) - usual_s
        if abs(off_s) > settings.clock:
            what = f"its stamps are {abs(off_s):.2f} s {'ahead of' if off_s > 0 else 'behind'} those of the others"
            yield Finding(_CHECK, Light.RED, what, "set all clocks by one (NTP, PTP), then record again", of)
        drift = _drift_ppm(camera.recorded_s, camera.stamps_s)
        if abs(drift) > settings.drift:
            what = f"its stamps go {abs(drift):.0f} ppm too {'fast' if drift > 0 else 'slow'}"
            yield Finding(_CHECK, Light.AMBER, what, "drifts of some 100 are found by motion, not more", of)
    apart_ms = 1e3 * max((abs(ahead - usual_s) for ahead in ahead_s.values()), default=0.0)
    yield Finding(
        _CHECK, Light.GREEN, f"stamps and times of recording {apart_ms:.0f} ms apart at most, from camera to camera"
    )


def _by_sound(recording: SampledRecording) -> Iterator[Finding]:
    deaf = [camera.name for camera in recording.cameras if not camera.has_sound]
    for name in deaf:
        what = "has no sound, so a clap does not tell its clock"
        yield Finding(_CHECK, Light.AMBER, what, "switch its sound on; else its motion must tell", f"camera {name}")
    if len(deaf) < len(recording.cameras):
        heard = len(recording.cameras) - len(deaf)
        yield Finding(_CHECK, Light.GREEN, f"{heard} videos with sound; 'bodycam ingest' brings them to one time")


def _drift_ppm(recorded_s: np.ndarray, stamps_s: np.ndarray) -> float:
    """By which stamps go faster than the recorder's clock; 0 where it cannot be told."""
    if len(stamps_s) < _FEWEST or np.ptp(recorded_s) < _LONG_S:
        return 0.0
    half = len(stamps_s) // 2
    # Medians of halves: transport delays single images, never the clock.
    ahead = stamps_s - recorded_s
    later_s = float(np.median(recorded_s[half:]) - np.median(recorded_s[:half]))
    return 1e6 * float(np.median(ahead[half:]) - np.median(ahead[:half])) / later_s
