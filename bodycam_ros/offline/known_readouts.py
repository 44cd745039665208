"""The read-out times that a body file knows of a recording's cameras."""

from collections.abc import Iterable

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.camera.readout import Readout
from bodycam_ros.recording.bag_reader import Recording


def known_readouts(recording: Recording, body: BodyModel, cameras: Iterable[str]) -> dict[str, Readout]:
    """Camera -> its read-out time by the body file, hardly known where the recording is in another video mode."""
    known = {
        camera: body.mounts[camera].readout_in(recording.video_mode(camera))
        for camera in cameras
        if body.mounts[camera].readout is not None
    }
    return {camera: readout for camera, readout in known.items() if readout is not None}
