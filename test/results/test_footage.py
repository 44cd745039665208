"""What is drawn over a camera's image, pixel by pixel where it must be."""

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.stick_figure import Bone, body_bones
from bodycam_ros.camera import CameraModel, camera_from_info
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.geometry import exp_so3, rigid, transform_points
from bodycam_ros.messages.timing import timing_messages
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.typestore import recorded_messages
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.results.camera_picture import CameraPicture, draw_picture
from bodycam_ros.results.colours import LEFT, rgb
from bodycam_ros.results.footage import Footage
from bodycam_ros.timing.clock_state import ClockHistory, ClockState
from bodycam_ros.viewer.motion import read_motion

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
    assert tuple(picture.pixels[row, column]) == rgb(LEFT)
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
    footage, instant = Footage(sample / "sample" / "bag", sample_out), 30
    assert len(footage.times_ns("shin_left")) == 60
    image = footage.image_at("shin_left", int(motion.stamps_ns[instant]), motion.frame_ns // 2)
    assert image is not None
    world_T_segment = motion.segments_at(body, instant)
    world_T_camera = world_T_segment[body.segment_index["shin_left"]] @ body.mounts["shin_left"].segment_T_camera
    limbs = body_bones(body, world_T_segment)
    found = footage.matches_of(image)
    model = footage.model("shin_left")
    right = draw_picture(image, model, world_T_camera, limbs, found)
    assert right.error_px < 2.0
    wrong = draw_picture(image, model, world_T_camera @ rigid(np.eye(3), np.array([0.05, 0, 0])), limbs, found)
    assert wrong.error_px > 2 * right.error_px


def test_images_are_those_of_the_recording_in_any_order(sample: Path) -> None:
    footage = Footage(sample / "sample" / "bag", None)
    times_ns = footage.times_ns("head")
    with open_recording(sample / "sample" / "bag") as recording:
        expected = [decode_grey(image) for image in recording.images(["head"])]
    assert len(expected) == len(times_ns)
    for row in (40, 3, 41, 59, 0):
        image = footage.image_at("head", int(times_ns[row]) + 1000, 2000)
        assert image is not None and np.array_equal(decode_grey(image), expected[row])
    assert footage.image_at("head", int(times_ns[-1]) + 3000, 2000) is None


def test_images_are_found_by_the_time_that_the_body_knows(sample: Path, tmp_path: Path) -> None:
    bag = sample / "sample" / "bag"
    plain_ns = Footage(bag, None).times_ns("head")
    start_ns = int(plain_ns[0])
    ahead = ClockHistory("head", (ClockState(start_ns, start_ns, 0.020, 0.0, 0.001, 0.0),))
    with write_recording(tmp_path / "out") as writer:
        for since_ns, message in timing_messages(recorded_messages(), ahead):
            writer.write("/head/timing", since_ns, message)
    assert (plain_ns - Footage(bag, tmp_path / "out").times_ns("head")).tolist() == [20_000_000] * len(plain_ns)
