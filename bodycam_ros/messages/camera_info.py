"""A camera's lens as a message."""

import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.messages.factory import Message, MessageFactory
from bodycam_ros.messages.header import header_message, optical_frame


def camera_info_message(make: MessageFactory, camera: CameraModel, stamp_ns: int) -> Message:
    """sensor_msgs/CameraInfo of a lens; what rectified images would need is left as if nothing had to be rectified."""
    k = np.array(camera.k)
    return make(
        "sensor_msgs/msg/CameraInfo",
        header=header_message(make, stamp_ns, make.frame(optical_frame(camera.name))),
        width=camera.width,
        height=camera.height,
        distortion_model=camera.distortion_model,
        d=make.sequence(np.array(camera.distortion)),
        k=k,
        r=np.eye(3).reshape(-1),
        p=np.insert(k, (3, 6, 9), 0.0),
    )
