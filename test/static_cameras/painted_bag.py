"""A bag of a painted person, with all that says where stations and person are."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from static_cameras.dressed_body import DressedBody, small_motion, static_cameras_around

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.limb_mesh import capsule_surfaces
from bodycam_ros.formats.static_cameras_file import write_static_cameras
from bodycam_ros.geometry import exp_se3
from bodycam_ros.messages.factory import header_message
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.static_cameras.start_file import write_start

Array = NDArray[np.float64]

FRAMES = 10
START_NS = 1_700_000_000_000_000_000
FRAME_NS = 33_333_333


def dressed_body(sample: Path) -> DressedBody:
    body = read_body(sample / "body.yaml")
    return DressedBody(body, capsule_surfaces(body), static_cameras_around(3))


def write_painted(dressed: DressedBody, folder: Path) -> None:
    motion = small_motion(dressed.body, FRAMES)
    write_bag(dressed, motion, folder / "bag")
    write_static_cameras(folder / "cameras.yaml", dressed.stations.values())
    directions = np.random.default_rng(5).normal(size=(len(motion[0]), 2, 3))
    directions /= np.linalg.norm(directions, axis=2, keepdims=True)
    placed = motion[0] @ exp_se3(np.concatenate([0.07 * directions[:, 0], 0.02 * directions[:, 1]], axis=1))
    write_start(folder / "start.yaml", dict(zip(dressed.body.segments, placed, strict=True)))


def write_bag(dressed: DressedBody, motion: Array, path: Path) -> None:
    make = recorded_messages()
    with write_recording(path) as writer:
        for frame, poses in enumerate(motion):
            stamp_ns = START_NS + frame * FRAME_NS
            for name, picture in dressed.images(poses, 1.0, frame).items():
                camera, header = dressed.stations[name].camera, header_message(make, stamp_ns, f"{name}_optical_frame")
                info = make(
                    "sensor_msgs/msg/CameraInfo", header=header, width=camera.width, height=camera.height,
                    distortion_model=camera.distortion_model, d=np.array(camera.distortion), k=np.array(camera.k),
                )  # fmt: skip
                writer.write(f"/{name}/camera_info", stamp_ns, info)
                encoded = cv2.imencode(".jpg", picture, [cv2.IMWRITE_JPEG_QUALITY, 92])[1].reshape(-1)
                image = make("sensor_msgs/msg/CompressedImage", header=header, format="jpeg", data=encoded)
                writer.write(f"/{name}/image_raw/compressed", stamp_ns, image)
