"""Images and intrinsics from a camera driver (sensor_msgs)."""

from collections.abc import Callable, Mapping
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.camera.camera_image import ENCODINGS, CameraImage, FilePicture, RawPicture, VideoPacket
from bodycam_ros.camera.camera_info import part_of_image
from bodycam_ros.camera.model import optical_frame
from bodycam_ros.errors import LensError, RecordingError
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.messages.factory import Message, MessageFactory, header_message, numbers, stamp_ns

_GREY = ("mono8", "8UC1")
_CODECS = {"h264": "h264", "h265": "hevc", "hevc": "hevc"}


def image_stamp_ns(message: Message) -> int:
    """Stamp of an image of any of the types below [ns]."""
    return stamp_ns(message.header.stamp if hasattr(message, "header") else message.timestamp)


def compressed_image(message: Message, camera: str) -> CameraImage:
    """Camera image of a sensor_msgs/CompressedImage, still encoded.

    Its ``format`` is a file's ("jpeg"), or has the encoding too ("bayer_rggb8; png compressed").
    """
    stamp, file = stamp_ns(message.header.stamp), bytes(message.data)
    before, semicolon, after = str(message.format).partition(";")
    encoding = before.strip()
    # Files have BGR, as OpenCV writes them, except those of an old publisher.
    is_turned = encoding.startswith("rgb") and "compressed rgb" in after
    # A Bayer mosaic is named even if it was converted to colours before compression.
    is_mosaic = encoding.startswith("bayer_") and "compressed bgr" not in after
    if semicolon and (is_turned or is_mosaic):
        return CameraImage(camera, stamp, FilePicture(camera, stamp, file, encoding))
    return CameraImage(camera, stamp, file)


def compressed_video(message: Message, camera: str) -> CameraImage:
    """Camera image of a foxglove_msgs/CompressedVideo, a packet that its camera's ``VideoDecoder`` takes.

    Raises:
        RecordingError: a format other than H.264 and H.265.
    """
    codec = _CODECS.get(str(message.format).lower())
    if codec is None:
        raise RecordingError(
            f"video of the format {shown(message.format)} is not supported; expected h264 or h265",
            camera,
        )
    return CameraImage(camera, stamp_ns(message.timestamp), VideoPacket(codec, bytes(message.data)))


def raw_image(message: Message, camera: str) -> CameraImage:
    """Camera image of a sensor_msgs/Image in one of ``ENCODINGS``.

    Raises:
        RecordingError: another encoding, a size that the encoding cannot have, or fewer bytes than that wants.
    """
    name = str(message.encoding)
    if name not in ENCODINGS:
        raise RecordingError(
            f"the image encoding {shown(name)} is not supported; {other_than(name, ENCODINGS)}",
            camera,
        )
    encoding = ENCODINGS[name]
    height, width, step = int(message.height), int(message.width), int(message.step)
    across, down = encoding.block
    bytes_per_row = width * encoding.values * encoding.bits // 8
    rows = int(height * encoding.rows)
    size = f"an image of {width}x{height} {name}"
    if width % across or height % down:
        raise RecordingError(
            f"{size} cannot be: its width must be a multiple of {across}, its height of {down}", camera
        )
    if step < bytes_per_row or len(message.data) < rows * step or rows * width == 0:
        raise RecordingError(f"{size} with rows of {step} bytes cannot have {len(message.data)} bytes", camera)
    data = numbers(message.data, np.uint8, len(message.data))[: rows * step].reshape(rows, step)[:, :bytes_per_row]
    stamp = stamp_ns(message.header.stamp)
    if name in _GREY:
        return CameraImage(camera, stamp, np.ascontiguousarray(data))
    values = data if encoding.bits == 8 else _sixteen_bits(data, bool(message.is_bigendian))
    return CameraImage(
        camera, stamp, RawPicture(name, values.reshape(rows, width, -1) if encoding.values > 1 else values)
    )


def _sixteen_bits(rows: NDArray[np.uint8], is_bigendian: bool) -> NDArray[np.uint16]:
    """Values of rows of bytes, in this machine's order."""
    return np.ascontiguousarray(rows).view(">u2" if is_bigendian else "<u2").astype(np.uint16, copy=False)


class Transport(NamedTuple):
    """A way of sending images: end of a camera's topic, type, and what makes a camera image of a message."""

    ending: str
    kind: str
    convert: Callable[[Message, str], CameraImage]


COMPRESSED_VIDEO = "foxglove_msgs/msg/CompressedVideo"

TRANSPORTS: Mapping[str, Transport] = {
    "compressed": Transport("/image_raw/compressed", "sensor_msgs/msg/CompressedImage", compressed_image),
    "raw": Transport("/image_raw", "sensor_msgs/msg/Image", raw_image),
    "video": Transport("/image_raw/compressed_video", COMPRESSED_VIDEO, compressed_video),
    # As foxglove_compressed_video_transport names it.
    "foxglove": Transport("/image_raw/foxglove", COMPRESSED_VIDEO, compressed_video),
}
"""By name; where a camera has several, the first is read."""

INFO, INFO_TYPE = "/camera_info", "sensor_msgs/msg/CameraInfo"
"""End and type of a camera's topic of intrinsics."""


def camera_model(message: Message, camera: str) -> CameraModel:
    """Camera model of the images that a sensor_msgs/CameraInfo is sent with.

    The message has the intrinsics of the full image; the images are its region of interest, binned (REP-104).

    Raises:
        LensError: malformed intrinsics, an unknown distortion model, or a region that is not in the image.
    """
    d = numbers(message.d, np.float64, len(message.d)).tolist()
    k = numbers(message.k, np.float64, len(message.k)).tolist()
    full = camera_from_info(camera, int(message.width), int(message.height), message.distortion_model, d, k)
    roi, binning = message.roi, (max(1, int(message.binning_x)), max(1, int(message.binning_y)))
    offset, size = (int(roi.x_offset), int(roi.y_offset)), (int(roi.width), int(roi.height))
    if size == (0, 0) and offset == (0, 0):
        size = full.width, full.height
    if offset[0] + size[0] > full.width or offset[1] + size[1] > full.height or not all(size):
        raise LensError(
            f"its camera_info has a region of interest of {size[0]}x{size[1]} pixels at "
            f"{offset[0]}, {offset[1]}, which is not in an image of {full.width}x{full.height}",
            camera,
        )
    if min(size[0] // binning[0], size[1] // binning[1]) < 1:
        raise LensError(f"its camera_info has a binning of {binning[0]}x{binning[1]}: no pixel is left", camera)
    return part_of_image(full, offset, size, binning)


def camera_info_message(make: MessageFactory, camera: CameraModel, stamp_ns: int) -> Message:
    """sensor_msgs/CameraInfo of a lens; the rectification is the identity."""
    k = np.array(camera.k)
    return make(
        INFO_TYPE,
        header=header_message(make, stamp_ns, make.frame(optical_frame(camera.name))),
        width=camera.width,
        height=camera.height,
        distortion_model=camera.distortion_model,
        d=make.array(np.array(camera.distortion), np.float64),
        k=k,
        r=np.eye(3).reshape(-1),
        p=np.insert(k, (3, 6, 9), 0.0),
    )
