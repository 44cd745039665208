"""A camera's lens, and its clock and rows, as messages."""

import math

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.messages.factory import Message, MessageFactory
from bodycam_ros.messages.header import header_message, optical_frame


def camera_info_message(make: MessageFactory, camera: CameraModel, stamp_ns: int) -> Message:
    """sensor_msgs/CameraInfo of a lens; what rectified images would need is left as if nothing had to be rectified."""
    k = np.array([camera.fx, 0.0, camera.cx, 0.0, camera.fy, camera.cy, 0.0, 0.0, 1.0])
    return make(
        "sensor_msgs/msg/CameraInfo",
        header=header_message(make, stamp_ns, optical_frame(camera.name)),
        width=camera.width,
        height=camera.height,
        distortion_model=camera.distortion_model,
        d=make.sequence(np.array(camera.distortion)),
        k=k,
        r=np.eye(3).reshape(-1),
        p=np.insert(k, (3, 6, 9), 0.0),
    )


def given_timing_message(
    make: MessageFactory,
    camera: str,
    stamp_ns: int,
    source: str,
    offset_sigma_s: float,
    drift_sigma: float,
    readout_s: float | None,
) -> Message:
    """bodycam_msgs/CameraTiming of a camera whose stamps are in the recording's time already.

    Args:
        make: makes the message.
        camera: its name.
        stamp_ns: since when it holds [ns].
        source: who knows the camera's clock: claps, sound, motion, telemetry or given.
        offset_sigma_s: standard deviation of what its stamps may still be off [s].
        drift_sigma: standard deviation of how that grows.
        readout_s: from the middle of the exposure of the first row to that of the last [s], if it was given.
    """
    return make(
        "bodycam_msgs/msg/CameraTiming",
        header=header_message(make, stamp_ns, optical_frame(camera)),
        source=source,
        offset=0.0,
        offset_sigma=offset_sigma_s,
        drift=0.0,
        drift_sigma=drift_sigma,
        readout_time=math.nan if readout_s is None else readout_s,
        readout_sigma=math.nan if readout_s is None else 0.0,
    )
