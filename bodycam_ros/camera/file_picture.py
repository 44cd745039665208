"""Images in files: JPEG and PNG, also those whose pixels are not what they seem."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.pixel_encoding import ENCODINGS
from bodycam_ros.errors import RecordingError
from bodycam_ros.shown import shown


@dataclass(frozen=True, eq=False)
class FilePicture:
    """A file whose values are to be read by the name of an encoding: the mosaic of a sensor, colours turned round.

    Attributes:
        camera: the camera's name.
        stamp_ns: of the image [ns].
        file: JPEG or PNG.
        encoding: what was put in it, such as "bayer_rggb8".
    """

    camera: str
    stamp_ns: int
    file: bytes
    encoding: str

    @property
    def nbytes(self) -> int:
        """Memory that it takes."""
        return len(self.file)

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W).

        Raises:
            RecordingError: it cannot be decoded, or does not hold what it is said to.
        """
        name, values = self._decoded()
        return ENCODINGS[name].grey(values)

    def colour(self) -> NDArray[np.uint8]:
        """Pixels (H, W, 3): blue, green, red.

        Raises:
            RecordingError: as of ``grey``.
        """
        name, values = self._decoded()
        return ENCODINGS[name].colour(values)

    def _decoded(self) -> tuple[str, NDArray[Any]]:
        """The encoding, with the bits that the file has, and its values."""
        values = file_values(self.camera, self.stamp_ns, self.file, cv2.IMREAD_UNCHANGED)
        bits = 8 * values.itemsize
        name = f"{self.encoding.rstrip('0123456789')}{bits}"
        depth = values.shape[2] if values.ndim == 3 else 1
        if name not in ENCODINGS or ENCODINGS[name].values != depth:
            raise RecordingError(
                f"camera {self.camera}: the image of stamp {self.stamp_ns} ns is said to be {shown(self.encoding)}, "
                f"but its file has {depth} values of {bits} bits a pixel"
            )
        return name, values


def file_values(camera: str, stamp_ns: int, file: bytes, mode: int) -> NDArray[Any]:
    """Decode a file, as one of OpenCV's ways of reading images wants.

    Args:
        camera: whose image it is, for the message.
        stamp_ns: of the image [ns], for the message.
        file: JPEG or PNG.
        mode: such as ``cv2.IMREAD_GRAYSCALE``.

    Raises:
        RecordingError: it is no image that OpenCV can decode.
    """
    encoded = np.frombuffer(file, dtype=np.uint8)
    try:
        values = cv2.imdecode(encoded, mode) if encoded.size else None
    except cv2.error:  # a header that claims an absurd size
        values = None
    if values is None:
        raise RecordingError(
            f"camera {camera}: the image of stamp {stamp_ns} ns ({len(file)} bytes) "
            "cannot be decoded; expected JPEG or PNG"
        )
    return np.asarray(values)
