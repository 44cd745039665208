"""Which cameras are there, and which should be."""

from collections.abc import Collection, Iterator

from bodycam_ros.doctor.finding import Finding, Light
from bodycam_ros.doctor.sampled_recording import SampledRecording

_CHECK = "cameras"


def check_cameras(recording: SampledRecording, wanted: Collection[str] | None) -> Iterator[Finding]:
    """Say which cameras a rig or body lacks, and which images cannot be decoded.

    Args:
        recording: samples.
        wanted: cameras of the rig or body; None if nobody said.
    """
    there = {camera.name for camera in recording.cameras}
    for reason in recording.left_out:
        yield Finding(_CHECK, Light.RED, reason)
    for name in sorted(set(wanted or ()) - there):
        what, remedy = "is not in the recording", "was it switched on? record again with it, or take it out of the rig"
        yield Finding(_CHECK, Light.RED, what, remedy, f"camera {name}")
    for name in sorted(there - set(wanted)) if wanted is not None else ():
        what = "nobody says where it is worn"
        yield Finding(
            _CHECK, Light.AMBER, what, "it will be left out; is its name spelt as in the rig?", f"camera {name}"
        )
    for camera in recording.cameras:
        if camera.fault or not camera.images:
            what = camera.fault or "none of the sampled images is there"
            remedy = "look at its recording; record again" if not camera.fault else ""
            yield Finding(_CHECK, Light.RED, what, remedy, f"camera {camera.name}")
    sizes = {f"{grey.shape[1]} x {grey.shape[0]}" for camera in recording.cameras for grey in camera.images.values()}
    what = f"{len(there)} cameras, {recording.duration_s:.1f} s, {' and '.join(sorted(sizes)) or 'no image'}"
    yield Finding(_CHECK, Light.GREEN, what)
