"""The times of a film's frames: evenly spaced, or those of a camera's images, which come with them."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_colour
from bodycam_ros.errors import ViewError
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.film.picture import Image
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.results.solved_body import SolvedBody
from bodycam_ros.results.topics import read_clock


class EvenFrames:
    """Frames of a rate over the time of all states.

    Attributes:
        stamps_ns: (F,) [ns].
        rate_hz: frames a second.
    """

    def __init__(self, solved: SolvedBody, rate_hz: float) -> None:
        first_ns, last_ns = (int(stamp) for stamp in solved.stamps_ns[[0, -1]])
        count = 1 + int((last_ns - first_ns) * 1e-9 * rate_hz + 1e-6)
        self.rate_hz = rate_hz
        self.stamps_ns: NDArray[np.int64] = first_ns + np.round(np.arange(count) * 1e9 / rate_hz).astype(np.int64)

    def images(self) -> Iterator[Image | None]:
        """No image for any frame."""
        yield from [None] * len(self.stamps_ns)


class RecordedFrames:
    """Frames that are a camera's images within the time of the states.

    Attributes:
        camera: that they are of.
        lens: as the recording has it.
        stamps_ns: (F,) by the camera's corrected clock [ns].
        rate_hz: about as many a second.
        readout_s: from the exposure of the first row to that of the last [s]; 0 where it is not known.

    Raises:
        ViewError: there is no recording, it has no such camera, or no image from that time.
        RecordingError: the bag is damaged.
    """

    def __init__(self, recording: Path | None, solved: SolvedBody, camera: str, flag: str) -> None:
        if recording is None:
            raise ViewError(f"{flag}: give the bag with its images with --recording")
        self.camera, self._recording = camera, recording
        with open_recording(recording) as bag:
            if camera not in bag.cameras:
                raise ViewError(f"{flag}: {recording} has no images of it; {other_than(camera, bag.cameras)}")
            self.lens: CameraModel = bag.camera_model(camera)
            given_ns = bag.image_times()[camera][:, 1]
        clock = read_clock(solved.path, camera)
        readout = None if clock is None else clock.readout
        self.readout_s = 0.0 if readout is None else readout.in_use
        corrected_ns = given_ns if clock is None else clock.corrected_ns(given_ns)
        inside = (corrected_ns >= solved.stamps_ns[0]) & (corrected_ns <= solved.stamps_ns[-1])
        if not inside.any():
            raise ViewError(f"{recording}: has no image of {shown(camera)} from the time that {solved.path} has")
        self._given_ns = set(given_ns[inside].tolist())
        self.stamps_ns: NDArray[np.int64] = np.sort(corrected_ns[inside])
        steps_ns = np.diff(self.stamps_ns)
        self.rate_hz = 1e9 / float(np.median(steps_ns)) if len(steps_ns) else 30.0

    def images(self) -> Iterator[Image]:
        """Pixels (H, W, 3), blue, green, red, of each frame.

        Raises:
            RecordingError: an image cannot be decoded.
        """
        with open_recording(self._recording) as bag:
            for image in bag.images([self.camera]):
                if image.stamp_ns in self._given_ns:
                    yield np.ascontiguousarray(decode_colour(image))


Frames = EvenFrames | RecordedFrames
