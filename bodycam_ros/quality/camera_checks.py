"""Which cameras are there, and which should be."""

from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

import numpy as np

from bodycam_ros.camera.model import mode_of_size
from bodycam_ros.geometry import Array
from bodycam_ros.lens.recorded_lens import other_lenses
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.quality.doctor_settings import DoctorSettings
from bodycam_ros.quality.finding import Finding, Light, by_limits
from bodycam_ros.quality.sampled_recording import RegisteredSamples, SampledCamera, SampledRecording

_CAMERAS = "cameras"


def check_cameras(recording: SampledRecording, wanted: Collection[str] | None) -> Iterator[Finding]:
    """Say which cameras a rig or body lacks, and which images cannot be decoded.

    Args:
        recording: samples.
        wanted: cameras of the rig or body; None if nobody said.
    """
    there = {camera.name for camera in recording.cameras}
    for reason in recording.left_out:
        yield Finding(_CAMERAS, Light.RED, reason)
    for name in sorted(set(wanted or ()) - there):
        what, remedy = "is not in the recording", "was it switched on? record again with it, or take it out of the rig"
        yield Finding(_CAMERAS, Light.RED, what, remedy, f"camera {name}")
    for name in sorted(there - set(wanted)) if wanted is not None else ():
        what = "nobody says where it is worn"
        yield Finding(
            _CAMERAS, Light.AMBER, what, "it will be left out; is its name spelt as in the rig?", f"camera {name}"
        )
    for camera in recording.cameras:
        if camera.fault or not camera.images:
            what = camera.fault.removeprefix(f"camera {camera.name}: ") or "none of the sampled images is there"
            remedy = "look at its recording; record again" if not camera.fault else ""
            yield Finding(_CAMERAS, Light.RED, what, remedy, f"camera {camera.name}")
    sizes = {f"{grey.shape[1]} x {grey.shape[0]}" for camera in recording.cameras for grey in camera.images.values()}
    what = f"{len(there)} cameras, {recording.duration_s:.1f} s, {' and '.join(sorted(sizes)) or 'no image'}"
    yield Finding(_CAMERAS, Light.GREEN, what)


_CLOCKS = "clocks"
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
            yield Finding(_CLOCKS, light, what, "these images are left out; stamp images when they are taken", of)
        off_s = ahead_s.get(camera.name, usual_s) - usual_s
        if abs(off_s) > settings.clock:
            what = f"its stamps are {abs(off_s):.2f} s {'ahead of' if off_s > 0 else 'behind'} those of the others"
            yield Finding(_CLOCKS, Light.RED, what, "set all clocks by one (NTP, PTP), then record again", of)
        drift = _drift_ppm(camera.recorded_s, camera.stamps_s)
        if abs(drift) > settings.drift:
            what = f"its stamps go {abs(drift):.0f} ppm too {'fast' if drift > 0 else 'slow'}"
            yield Finding(_CLOCKS, Light.AMBER, what, "drifts of some 100 are found by motion, not more", of)
    apart_ms = 1e3 * max((abs(ahead - usual_s) for ahead in ahead_s.values()), default=0.0)
    yield Finding(
        _CLOCKS,
        Light.GREEN,
        f"stamps and times of recording {apart_ms:.0f} ms apart at most, from camera to camera",
    )


def _by_sound(recording: SampledRecording) -> Iterator[Finding]:
    deaf = [camera.name for camera in recording.cameras if not camera.has_sound]
    for name in deaf:
        what = "has no sound, so a clap does not tell its clock"
        yield Finding(_CLOCKS, Light.AMBER, what, "switch its sound on; else its motion must tell", f"camera {name}")
    if len(deaf) < len(recording.cameras):
        heard = len(recording.cameras) - len(deaf)
        yield Finding(_CLOCKS, Light.GREEN, f"{heard} videos with sound; 'bodycam ingest' brings them to one time")


def _drift_ppm(recorded_s: Array, stamps_s: Array) -> float:
    """By which stamps go faster than the recorder's clock; 0 where it cannot be told."""
    if len(stamps_s) < _FEWEST or np.ptp(recorded_s) < _LONG_S:
        return 0.0
    half = len(stamps_s) // 2
    # Medians of halves: transport delays single images, never the clock.
    ahead = stamps_s - recorded_s
    later_s = float(np.median(recorded_s[half:]) - np.median(recorded_s[:half]))
    return 1e6 * float(np.median(ahead[half:]) - np.median(ahead[:half])) / later_s


_RATE, _GAPS = "rate", "gaps"
_FEWEST_IMAGES = 3  # images, of which a rate can be told
_SKIPPED = 2.5  # intervals: an image is missing
_BAD_LOSS = 10.0  # times the share that is amber
_REMEDY = "a faster card, a shorter cable, fewer pixels or images a second; then record again"


def check_rates(recording: SampledRecording, settings: DoctorSettings) -> Iterator[Finding]:
    """Say which cameras are slow, have gaps, begin late or end early."""
    usable = [camera for camera in recording.cameras if len(camera.stamps_s) >= _FEWEST_IMAGES]
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


_FIELD_OF_VIEW = "lens"


def check_field_of_view(
    recording: Path, registered: RegisteredSamples, settings: DoctorSettings, progress: Progress
) -> Iterator[Finding]:
    """Compare lenses with what their cameras saw: some seconds a camera, so only of those that give cause to."""
    doubted: Sequence[str] = sorted(c for c in registered.poses if registered.share(c) < settings.registered)
    if not doubted:
        return
    with progress.step("lenses", len(doubted)) as advance:
        for camera in doubted:
            for match in other_lenses(recording, [camera]):
                said = match.text.removeprefix(f"camera {camera}: ")
                yield Finding(_FIELD_OF_VIEW, Light.RED, said, of=f"camera {camera}")
            advance()


_LENS = "lens"
_OFF_CENTRE = 0.25  # of the picture, by which a principal point is off; more is of a picture that was cut


def check_lens(recording: SampledRecording) -> Iterator[Finding]:
    """Compare sizes; what a field of view should look like is for whoever knows tracks."""
    models = []
    for camera in recording.cameras:
        faults = list(_of(camera))
        yield from faults
        if camera.lens is not None and not any(fault.light is Light.RED for fault in faults):
            models.append(camera.lens.distortion_model)
    if models:
        named = ", ".join(sorted(set(models)))
        yield Finding(_LENS, Light.GREEN, f"{len(models)} lenses ({named}) for images of their size")


def _of(camera: SampledCamera) -> Iterator[Finding]:
    of = f"camera {camera.name}"
    if camera.lens is None:
        yield Finding(_LENS, Light.RED, camera.lens_fault.removeprefix(f"{of}: "), of=of)
        return
    lens = camera.lens
    sizes = {(grey.shape[1], grey.shape[0]) for grey in camera.images.values()} - {(lens.width, lens.height)}
    for width, height in sorted(sizes):
        what = f"its images have {width} x {height} px, its lens is for {lens.width} x {lens.height}"
        remedy = mode_of_size((lens.width, lens.height), (width, height))
        yield Finding(_LENS, Light.RED, what, remedy, of)
    off = max(abs(lens.cx / lens.width - 0.5), abs(lens.cy / lens.height - 0.5))
    if off > _OFF_CENTRE:
        what = f"its lens's middle is {off:.0%} of the picture off"
        yield Finding(_LENS, Light.AMBER, what, "was the picture cut after it was calibrated?", of)
