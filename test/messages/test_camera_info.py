import pytest

from bodycam_ros.camera import camera_from_info
from bodycam_ros.messages.camera_info import camera_info_message
from bodycam_ros.messages.images import camera_model
from bodycam_ros.recording.typestore import recorded_messages, recording_typestore

K = [300.0, 0.0, 320.0, 0.0, 301.0, 240.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize(
    ("model", "d"),
    [("plumb_bob", [0.1, 0.0, 0.01, 0.0, 0.0]), ("equidistant", [0.1, 0.0, 0.0, 0.01]), ("fov", [0.9])],
)
def test_a_lens_comes_back_as_it_was(model: str, d: list[float]) -> None:
    camera = camera_from_info("head", 640, 480, model, d, K)
    message = camera_info_message(recorded_messages(), camera, 5_000_000_007)
    cdr = recording_typestore().serialize_cdr(message, "sensor_msgs/msg/CameraInfo")
    again = recording_typestore().deserialize_cdr(cdr, "sensor_msgs/msg/CameraInfo")
    assert vars(camera_model(again, "head")).keys() == vars(camera).keys()
    read = camera_model(again, "head")
    assert (read.width, read.height, read.fx, read.fy, read.cx, read.cy) == (640, 480, 300.0, 301.0, 320.0, 240.0)
    assert (read.distortion_model, read.distortion) == (model, camera.distortion)
    assert again.p.tolist() == [300.0, 0.0, 320.0, 0.0, 0.0, 301.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0]
    assert (again.header.stamp.sec, again.header.stamp.nanosec, again.header.frame_id) == (5, 7, "head_optical_frame")
