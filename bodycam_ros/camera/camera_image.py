"""One image of one camera, decoded only where it is looked at."""

from contextlib import suppress
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any, Final, Protocol

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera.model import CameraModel
from bodycam_ros.camera.picture_size import check_picture_size
from bodycam_ros.errors import BodycamError, RecordingError
from bodycam_ros.files.shown import shown

_BITS = {"8": 8, "16": 16}
_MOSAICS = {"rggb": "BG", "bggr": "RG", "gbrg": "GR", "grbg": "GB"}
"""ROS names a mosaic by its first two rows from the corner; OpenCV by two pixels of the second row."""


@dataclass(frozen=True)
class PixelEncoding:
    """How the bytes of an image are to be read.

    Attributes:
        bits: of a value: 8 or 16, all of them used.
        values: per pixel and row.
        to_grey: OpenCV's conversion to grey; None where the values are.
        to_colour: OpenCV's conversion to blue, green, red; None where the values are.
        block: width and height must be multiples of these.
        rows: of values per row of pixels: 1.5 where colours follow in a plane of their own.
    """

    bits: int
    values: int
    to_grey: int | None
    to_colour: int | None
    block: tuple[int, int] = (1, 1)
    rows: float = 1.0


def _eight_bits(values: NDArray[Any]) -> NDArray[np.uint8]:
    return np.asarray(values if values.dtype == np.uint8 else values >> 8, dtype=np.uint8)


def _encodings() -> dict[str, PixelEncoding]:
    known = {
        "8UC1": PixelEncoding(8, 1, None, cv2.COLOR_GRAY2BGR),
        "8UC3": PixelEncoding(8, 3, cv2.COLOR_BGR2GRAY, None),
    }
    for name, bits in _BITS.items():
        known["mono" + name] = PixelEncoding(bits, 1, None, cv2.COLOR_GRAY2BGR)
        known["bgr" + name] = PixelEncoding(bits, 3, cv2.COLOR_BGR2GRAY, None)
        known["rgb" + name] = PixelEncoding(bits, 3, cv2.COLOR_RGB2GRAY, cv2.COLOR_RGB2BGR)
        known["bgra" + name] = PixelEncoding(bits, 4, cv2.COLOR_BGRA2GRAY, cv2.COLOR_BGRA2BGR)
        known["rgba" + name] = PixelEncoding(bits, 4, cv2.COLOR_RGBA2GRAY, cv2.COLOR_RGBA2BGR)
        for mosaic, opencv in _MOSAICS.items():
            grey, colour = (getattr(cv2, f"COLOR_Bayer{opencv}2{kind}") for kind in ("GRAY", "BGR"))
            known[f"bayer_{mosaic}{name}"] = PixelEncoding(bits, 1, grey, colour, block=(2, 2))
    uyvy = PixelEncoding(8, 2, cv2.COLOR_YUV2GRAY_UYVY, cv2.COLOR_YUV2BGR_UYVY, block=(2, 1))
    yuyv = PixelEncoding(8, 2, cv2.COLOR_YUV2GRAY_YUY2, cv2.COLOR_YUV2BGR_YUY2, block=(2, 1))
    known |= {"yuv422": uyvy, "uyvy": uyvy, "yuv422_yuy2": yuyv, "yuyv": yuyv}
    for name, code in (("nv12", cv2.COLOR_YUV2BGR_NV12), ("nv21", cv2.COLOR_YUV2BGR_NV21)):
        known[name] = PixelEncoding(8, 1, cv2.COLOR_YUV2GRAY_NV12, code, block=(2, 2), rows=1.5)
    return known


ENCODINGS: Final = _encodings()
"""Name of an encoding, as in ``sensor_msgs/Image``, -> what it means."""


@dataclass(frozen=True, eq=False)
class RawPicture:
    """Values that are left as they came until pixels are asked for: mostly grey ones, and no others are made.

    Attributes:
        encoding: of ``ENCODINGS``.
        values: (rows, W) or (rows, W, values) uint8 or uint16, maybe with a gap between the rows.
    """

    encoding: str
    values: NDArray[np.uint8] | NDArray[np.uint16]

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W); of YUV the luma as it is."""
        to_grey = ENCODINGS[self.encoding].to_grey
        return np.ascontiguousarray(_eight_bits(self.values if to_grey is None else cv2.cvtColor(self.values, to_grey)))

    def colour(self) -> NDArray[np.uint8]:
        """Pixels (H, W, 3): blue, green, red; the caller's own."""
        to_colour = ENCODINGS[self.encoding].to_colour
        if to_colour is None:
            return np.array(_eight_bits(self.values), order="C")
        return _eight_bits(cv2.cvtColor(self.values, to_colour))


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

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W); raises RecordingError as ``decoded``."""
        return self.decoded().grey()

    def colour(self) -> NDArray[np.uint8]:
        """Pixels (H, W, 3): blue, green, red; raises RecordingError as ``decoded``."""
        return self.decoded().colour()

    def decoded(self) -> RawPicture:
        """Its values, and the encoding with the bits that the file has.

        Raises:
            RecordingError: it cannot be decoded, or does not hold what its message claims.
        """
        values = file_values(self.camera, self.stamp_ns, self.file, cv2.IMREAD_UNCHANGED)
        bits = 8 * values.itemsize
        name = f"{self.encoding.rstrip('0123456789')}{bits}"
        depth = values.shape[2] if values.ndim == 3 else 1
        if name not in ENCODINGS or ENCODINGS[name].values != depth:
            raise RecordingError(
                f"the image of stamp {self.stamp_ns} ns claims to be {shown(self.encoding)}, "
                f"but its file has {depth} values of {bits} bits a pixel",
                self.camera,
            )
        return RawPicture(name, values)


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
    values = _decoded(file, mode)
    if values is None:
        raise RecordingError(
            f"the image of stamp {stamp_ns} ns ({len(file)} bytes) cannot be decoded; expected JPEG or PNG",
            camera,
        )
    return values


def read_image_file(
    path: Path, mode: int, error: type[BodycamError] = RecordingError, lens: CameraModel | None = None
) -> NDArray[np.uint8]:
    """Pixels of an image file.

    Orientation tags are ignored: a calibration holds for the sensor's own rows and columns. OpenCV's own reading of
    files crashes on names that are not UTF-8.

    Args:
        path: of the file.
        mode: IMREAD_COLOR or IMREAD_GRAYSCALE of OpenCV.
        error: raised where it is none.
        lens: of the camera that took it.

    Raises:
        BodycamError: it cannot be read, or is absurdly large for the lens.
    """
    with suppress(OSError):
        file = path.read_bytes()
        if lens is not None:
            try:
                check_picture_size(file, lens)
            except RecordingError as too_large:
                raise error(f"{path}: {too_large}") from too_large
        pixels = _decoded(file, mode | cv2.IMREAD_IGNORE_ORIENTATION)
        if pixels is not None:
            return pixels
    raise error(f"{path}: is no image that can be read; expected a whole JPEG or PNG file")


def _decoded(file: bytes, mode: int) -> NDArray[Any] | None:
    try:
        values = cv2.imdecode(np.frombuffer(file, np.uint8), mode) if file else None
    except cv2.error:  # a header that claims an absurd size
        return None
    return None if values is None else np.asarray(values)


_START_CODE = b"\x00\x00\x01"
_H264_SLICES, _H264_KEY = range(1, 6), {5, 7}  # an IDR slice, or the sequence's parameters before an intra frame
_HEVC_SLICES, _HEVC_KEY = range(0, 32), {*range(16, 22), 33}


@dataclass(frozen=True)
class VideoPacket:
    """What decodes to exactly one frame, once the frames since the last keyframe were decoded.

    Attributes:
        codec: "h264" or "hevc".
        data: NAL units in the form of Annex B; with a keyframe the stream's parameters.
    """

    codec: str
    data: bytes

    @cached_property
    def is_key(self) -> bool:
        """Whether decoding can begin here."""
        hevc = self.codec == "hevc"
        slices, key = (_HEVC_SLICES, _HEVC_KEY) if hevc else (_H264_SLICES, _H264_KEY)
        at = self.data.find(_START_CODE)
        while 0 <= at < len(self.data) - 3:
            header = self.data[at + 3]
            kind = header >> 1 & 0x3F if hevc else header & 0x1F
            if kind in key:
                return True
            if kind in slices:
                return False
            at = self.data.find(_START_CODE, at + 3)
        return False


class Picture(Protocol):
    """A picture that is decoded, but whose pixels are not made yet."""

    def grey(self) -> NDArray[np.uint8]:
        """Grey pixels (H, W)."""

    def colour(self) -> NDArray[np.uint8]:
        """Pixels (H, W, 3): blue, green, red."""


@dataclass(frozen=True)
class CameraImage:
    """An image as it came.

    Attributes:
        camera: the camera's name.
        stamp_ns: mid-exposure of the middle row [ns].
        content: the file's bytes (JPEG or PNG), the pixels of a raw image, uint8, grey (H, W) or (H, W, 3) in the
            order blue, green, red, a picture in another encoding, raw or in a file, a video's frame, decoded or still a
            packet, or the error that says why there is none.
        recorded_ns: when it came, of a recording [ns]; of a video's frame, when what completed it came.
    """

    camera: str
    stamp_ns: int
    content: bytes | NDArray[np.uint8] | Picture | VideoPacket | RecordingError
    recorded_ns: int = 0


def check_image_size(image: CameraImage, lens: CameraModel) -> None:
    """Refuse an image whose file claims to be absurdly large for the camera's lens, before it is decoded.

    Raises:
        RecordingError: so it is.
    """
    file = image.content.file if isinstance(image.content, FilePicture) else image.content
    if isinstance(file, bytes):
        check_picture_size(file, lens)


def decode_grey(image: CameraImage) -> NDArray[np.uint8]:
    """Grey pixels (H, W) uint8.

    Raises:
        RecordingError: the bytes are no image that OpenCV can decode, the pixels are none, the message was malformed,
            or it is a video's packet, which only a ``VideoDecoder`` that saw those before it can decode.
    """
    content = _decodable(image, cv2.IMREAD_GRAYSCALE)
    if not isinstance(content, np.ndarray):
        return content.grey()
    return content if content.ndim == 2 else np.asarray(cv2.cvtColor(content, cv2.COLOR_BGR2GRAY), dtype=np.uint8)


def decode_colour(image: CameraImage) -> NDArray[np.uint8]:
    """Pixels (H, W, 3) uint8: blue, green, red, row by row, the caller's own; three times the same of a grey image.

    Raises:
        RecordingError: as of ``decode_grey``.
    """
    content = _decodable(image, cv2.IMREAD_COLOR)
    if not isinstance(content, np.ndarray):
        return content.colour()
    return content if content.ndim == 3 else np.asarray(cv2.cvtColor(content, cv2.COLOR_GRAY2BGR), dtype=np.uint8)


def _decodable(image: CameraImage, mode: int) -> NDArray[np.uint8] | Picture:
    """An image's content if it can be decoded by itself; of a file its pixels, in OpenCV's mode."""
    if isinstance(image.content, RecordingError):
        raise image.content
    if isinstance(image.content, VideoPacket):
        raise RecordingError("a video's packet is no picture without those before it", image.camera)
    if isinstance(image.content, bytes):
        return np.asarray(file_values(image.camera, image.stamp_ns, image.content, mode), dtype=np.uint8)
    if isinstance(image.content, np.ndarray):
        _check_pixels(image.camera, image.content)
    return image.content


def _check_pixels(camera: str, pixels: NDArray[Any]) -> None:
    """Raise RecordingError unless an array holds an image's pixels."""
    is_image = pixels.ndim == 2 or (pixels.ndim == 3 and pixels.shape[2] == 3)
    if not is_image or pixels.dtype != np.uint8 or not pixels.size:
        raise RecordingError(
            f"an array of shape {pixels.shape} and type {pixels.dtype} is no image; expected uint8, "
            "(height, width) grey or (height, width, 3) in the order blue, green, red",
            camera,
        )
