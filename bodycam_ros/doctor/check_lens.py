"""Whether every camera has a lens, and images of the size that this is for."""

from collections.abc import Iterator

from bodycam_ros.camera.other_size import mode_of_size
from bodycam_ros.doctor.finding import Finding, Light
from bodycam_ros.doctor.sampled_recording import SampledCamera, SampledRecording

_CHECK = "lens"
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
        yield Finding(_CHECK, Light.GREEN, f"{len(models)} lenses ({named}) for images of their size")


def _of(camera: SampledCamera) -> Iterator[Finding]:
    of = f"camera {camera.name}"
    if camera.lens is None:
        yield Finding(_CHECK, Light.RED, camera.lens_fault.removeprefix(f"{of}: "), of=of)
        return
    lens = camera.lens
    sizes = {(grey.shape[1], grey.shape[0]) for grey in camera.images.values()} - {(lens.width, lens.height)}
    for width, height in sorted(sizes):
        what = f"its images have {width} x {height} px, its lens is for {lens.width} x {lens.height}"
        remedy = mode_of_size((lens.width, lens.height), (width, height))
        yield Finding(_CHECK, Light.RED, what, remedy, of)
    off = max(abs(lens.cx / lens.width - 0.5), abs(lens.cy / lens.height - 0.5))
    if off > _OFF_CENTRE:
        what = f"its lens's middle is {off:.0%} of the picture off"
        yield Finding(_CHECK, Light.AMBER, what, "was the picture cut after it was calibrated?", of)
