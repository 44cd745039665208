"""What a camera driver publishes: images and intrinsics."""

import numpy as np

from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.camera.raw_picture import RawPicture
from bodycam_ros.camera.video_packet import VideoPacket
from bodycam_ros.errors import RecordingError
from bodycam_ros.messages.factory import Message, numbers
from bodycam_ros.messages.header import stamp_ns
from bodycam_ros.shown import shown

_CHANNELS = {"mono8": 1, "bgr8": 3, "rgb8": 3}
_CODECS = {"h264": "h264", "h265": "hevc", "hevc": "hevc"}


def image_stamp_ns(message: Message) -> int:
    """Stamp of an image of any of the types below [ns]."""
    return stamp_ns(message.header.stamp if hasattr(message, "header") else message.timestamp)


def compressed_image(message: Message, camera: str) -> CameraImage:
    """Camera image of a sensor_msgs/CompressedImage, still encoded."""
    return CameraImage(camera, stamp_ns(message.header.stamp), bytes(message.data))


def compressed_video(message: Message, camera: str) -> CameraImage:
    """Camera image of a foxglove_msgs/CompressedVideo, a packet that its camera's ``VideoDecoder`` takes.

    Raises:
        RecordingError: a format other than H.264 and H.265.
    """
    codec = _CODECS.get(str(message.format).lower())
    if codec is None:
        raise RecordingError(
            f"camera {camera}: video of the format {shown(message.format)} is not supported; expected h264 or h265"
        )
    return CameraImage(camera, stamp_ns(message.timestamp), VideoPacket(codec, bytes(message.data)))


def raw_image(message: Message, camera: str) -> CameraImage:
    """Camera image of a sensor_msgs/Image in mono8, bgr8 or rgb8.

    Raises:
        RecordingError: another encoding, or fewer bytes than the image's size wants.
    """
    if message.encoding not in _CHANNELS:
        raise RecordingError(
            f"camera {camera}: image encoding '{message.encoding}' is not supported; expected {', '.join(_CHANNELS)}"
        )
    channels = _CHANNELS[message.encoding]
    height, width, step = int(message.height), int(message.width), int(message.step)
    if step < width * channels or len(message.data) < height * step or height * width == 0:
        raise RecordingError(
            f"camera {camera}: an image of {width}x{height} {message.encoding} with rows of {step} bytes cannot have "
            f"{len(message.data)} bytes"
        )
    rows = numbers(message.data, np.uint8, len(message.data))[: height * step].reshape(height, step)
    pixels = rows[:, : width * channels]
    stamp = stamp_ns(message.header.stamp)
    if channels == 3:
        return CameraImage(camera, stamp, RawPicture(pixels.reshape(height, width, 3), message.encoding == "rgb8"))
    return CameraImage(camera, stamp, np.ascontiguousarray(pixels))


def camera_model(message: Message, camera: str) -> CameraModel:
    """Camera model of a sensor_msgs/CameraInfo.

    Raises:
        LensError: malformed intrinsics or an unknown distortion model.
    """
    d = numbers(message.d, np.float64, len(message.d)).tolist()
    k = numbers(message.k, np.float64, len(message.k)).tolist()
    return camera_from_info(camera, int(message.width), int(message.height), message.distortion_model, d, k)
