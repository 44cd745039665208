"""What is drawn over a camera's image, pixel by pixel where it must be."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray
from tiny_bag import HEIGHT, WIDTH, write_camera_info

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.stick_figure import Bone
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.geometry import exp_so3, rigid, transform_points
from bodycam_ros.messages.factory import header_message
from bodycam_ros.messages.timing import timing_messages
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.results.camera_picture import CameraPicture, draw_picture
from bodycam_ros.timing.clock_state import ClockHistory, ClockState
from bodycam_ros.viewer.footage import read_footage
from bodycam_ros.viewer.motion import read_motion
from bodycam_ros.viewer.scene_nodes import segment_rgb
from bodycam_ros.viewer.skeleton_scene import limbs_of

WORLD_T_CAMERA = rigid(exp_so3(np.array([0.3, -0.2, 0.9])), np.array([1.0, 2.0, 3.0]))
GREY = 90


@pytest.fixture
def camera() -> CameraModel:
    return camera_from_info("cam", 1280, 960, "equidistant", [0.01, 0.0, 0.0, 0.0], [600, 0, 640, 0, 600, 480, 0, 0, 1])


def in_world(points_camera: list[list[float]]) -> NDArray[np.float64]:
    return transform_points(WORLD_T_CAMERA, np.array(points_camera))


def matches(points_world: NDArray[np.float64], pixels: NDArray[np.float64]) -> LandmarkMatches:
    ids = np.arange(len(pixels), dtype=np.uint32)
    return LandmarkMatches(
        camera="cam",
        stamp_ns=1,
        previous_stamp_ns=0,
        track_ids=ids,
        landmark_ids=ids,
        pixels=pixels.astype(np.float32),
        points_world=points_world.astype(np.float32),
        world_T_camera=None,
        pose_covariance=np.eye(6),
        current_R_previous=np.eye(3),
        rotation_inliers=0,
    )


def drawn(camera: CameraModel, limbs: list[Bone], found: LandmarkMatches | None) -> CameraPicture:
    image = CameraImage("cam", 1, np.full((camera.height, camera.width), GREY, np.uint8))
    return draw_picture(image, camera, WORLD_T_CAMERA, limbs, found)


def test_limbs_are_drawn_in_their_side_s_colour_where_the_lens_puts_them(camera: CameraModel) -> None:
    ends = in_world([[-0.5, 0.2, 1.0], [0.4, 0.3, 1.2]])
    picture = drawn(camera, [Bone("shin_left", ends[:1], ends[1:])], None)
    assert picture.pixels.shape == (480, 640, 3)  # half of the image
    middle, _ = camera.project(np.array([[-0.05, 0.25, 1.1]]))
    column, row = np.round(middle[0] / 2).astype(int)
    assert tuple(picture.pixels[row, column]) == segment_rgb("shin_left")
    assert (picture.pixels[: row - 40] == GREY).all()
    assert np.isnan(picture.error_px)


def test_limbs_behind_the_camera_are_not_drawn(camera: CameraModel) -> None:
    ends = in_world([[0.0, 0.0, -1.0], [0.1, 0.1, -1.0]])
    assert (drawn(camera, [Bone("shin_left", ends[:1], ends[1:])], None).pixels == GREY).all()


def test_the_error_is_that_of_the_landmarks(camera: CameraModel) -> None:
    points = [[0.1, 0.2, 2.0], [-0.4, 0.1, 3.0], [0.5, -0.3, 2.5]]
    pixels, _ = camera.project(np.array(points))
    picture = drawn(camera, [], matches(in_world(points), pixels + np.array([6.0, 8.0])))
    assert picture.error_px == pytest.approx(10.0, abs=1e-3)


@pytest.mark.long
def test_landmarks_of_the_sample_fall_where_they_were_seen(sample: Path, sample_out: Path) -> None:
    body = read_body(sample / "body.yaml")
    motion = read_motion(sample_out, body)
    footage = read_footage(sample / "sample" / "bag", sample_out, "shin_left", lambda: True)
    assert footage is not None and len(footage.images) == 60
    instant = 30
    image = footage.image_at(int(motion.stamps_ns[instant]), motion.frame_ns // 2)
    assert image is not None
    world_T_segment = motion.segments_at(body, instant)
    world_T_camera = world_T_segment[body.segment_index["shin_left"]] @ body.mounts["shin_left"].segment_T_camera
    limbs = limbs_of(body, world_T_segment)
    found = footage.matches[image.stamp_ns]
    right = draw_picture(image, footage.model, world_T_camera, limbs, found)
    assert right.error_px < 2.0
    wrong = draw_picture(image, footage.model, world_T_camera @ rigid(np.eye(3), np.array([0.05, 0, 0])), limbs, found)
    assert wrong.error_px > 2 * right.error_px


def test_reading_stops_when_nobody_wants_it(sample: Path) -> None:
    assert read_footage(sample / "sample" / "bag", None, "head", lambda: False) is None


def test_of_a_long_recording_fewer_images_are_kept(sample: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = read_footage(sample / "sample" / "bag", None, "head", lambda: True)
    assert whole is not None
    size = sum(len(image.content) for image in whole.images if isinstance(image.content, bytes))
    monkeypatch.setattr("bodycam_ros.viewer.footage.MOST_BYTES", size // 3)
    thinned = read_footage(sample / "sample" / "bag", None, "head", lambda: True)
    assert thinned is not None
    assert thinned.times_ns.tolist() == whole.times_ns[::4].tolist()


def test_raw_images_with_colours_count_as_what_they_take(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    make, pixels = recorded_messages(), np.zeros((HEIGHT, WIDTH, 3), np.uint8)
    with write_recording(tmp_path / "bag") as writer:
        write_camera_info(writer, "cam", 0)
        for stamp_ns in range(10):
            header = header_message(make, stamp_ns, "cam")
            fields = {"height": HEIGHT, "width": WIDTH, "encoding": "rgb8", "step": 3 * WIDTH, "data": pixels.ravel()}
            writer.write("/cam/image_raw", stamp_ns, make("sensor_msgs/msg/Image", header=header, **fields))
    monkeypatch.setattr("bodycam_ros.viewer.footage.MOST_BYTES", 9 * pixels.nbytes)
    thinned = read_footage(tmp_path / "bag", None, "cam", lambda: True)
    assert thinned is not None and thinned.times_ns.tolist() == [0, 2, 4, 6, 8]


def test_images_are_found_by_the_time_that_the_body_knows(sample: Path, tmp_path: Path) -> None:
    bag = sample / "sample" / "bag"
    plain = read_footage(bag, None, "head", lambda: True)
    assert plain is not None
    begun_ns = int(plain.times_ns[0])
    ahead = ClockHistory("head", (ClockState(begun_ns, begun_ns, 0.020, 0.0, 0.001, 0.0),))
    with write_recording(tmp_path / "out") as writer:
        for since_ns, message in timing_messages(recorded_messages(), ahead):
            writer.write("/head/timing", since_ns, message)
    told = read_footage(bag, tmp_path / "out", "head", lambda: True)
    assert told is not None
    assert (plain.times_ns - told.times_ns).tolist() == [20_000_000] * len(plain.times_ns)
