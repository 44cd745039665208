"""The moving body as a video: from outside as the view opens, or over the images of a camera (A figures 1 and 8)."""

from collections.abc import Iterator
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from bodycam_ros.body.stick_figure import body_bones
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_colour
from bodycam_ros.errors import ViewError
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.files.whole_file import whole_file
from bodycam_ros.film.views import looking_at
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.progress import Progress
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.video_encoder import video_writer
from bodycam_ros.results.body_motion import nearest
from bodycam_ros.results.camera_picture import draw_body, draw_polyline
from bodycam_ros.results.picture_style import INK, rgb
from bodycam_ros.results.topics import read_clock
from bodycam_ros.viewer.motion import mounted_camera
from bodycam_ros.viewer.scene import GRID
from bodycam_ros.viewer.sources import Sources
from bodycam_ros.viewer.viewpoint import FIELD_OF_VIEW, OpeningView, grid_lines, points_to_see

Image = NDArray[np.uint8]

WIDTH, HEIGHT = 1280, 720
"""Size of the video from outside [px]."""

_REACH_M = 10.0  # of the floor's grid, around the viewer
_STEPS = 80  # pieces of a grid line: those in front of the camera are drawn
_NEAREST_M = 0.1  # of the grid
_SHARP_PX = 720  # a camera's picture of less height is magnified
_FOLLOW_S = 1.4  # the view from outside follows the mean of the root's path over this time
_BONE_SHARE = 0.008  # width of a bone as a share of the picture's height


def write_film(sources: Sources, camera: str | None, path: Path, progress: Progress) -> None:
    """Write the video as MP4, whole or not at all.

    Args:
        sources: the body and its motion.
        camera: whose images are under the body; None: from outside.
        path: the file to write.
        progress: of the frames.

    Raises:
        ViewError: there is no motion, or no image of the camera within it.
        RecordingError: not a recording, or an image that cannot be decoded.
        OutputError: the video cannot be written.
    """
    if sources.solved is None:
        raise ViewError("-o: a body in its N-pose does not move; name OUT, a bag that 'bodycam replay' wrote")
    shots = _from_outside(sources) if camera is None else _over_images(sources, camera, sources.solved)
    motion, body = sources.motion, sources.body
    with (
        whole_file(path) as unfinished,
        progress.step(path.name, len(motion.stamps_ns)) as advance,
        video_writer(unfinished, 1e9 / motion.frame_ns) as write,
    ):
        is_empty = True
        for seconds, index, picture, world_T_camera, lens in shots:
            bones = body_bones(body, motion.segments_at(body, index)) + motion.equipment_at(index)
            width = max(2, round(_BONE_SHARE * lens.height))
            draw_body(picture, lens, world_T_camera, bones, width, is_bgr=True)
            times = -(-_SHARP_PX // lens.height)
            picture = np.asarray(cv2.resize(picture, None, fx=times, fy=times), np.uint8)
            _write_time(picture, seconds)
            write(seconds, picture)
            advance()
            is_empty = False
        if is_empty:
            raise ViewError(f"{sources.recording}: has no image of {camera} from the time that {sources.solved} has")


_Shot = tuple[float, int, Image, Array, CameraModel]
"""Seconds since the first state, row of the state, picture without the body, world_T_camera (4, 4) and lens."""


def _from_outside(sources: Sources) -> Iterator[_Shot]:
    """A shot of every state."""
    motion, body = sources.motion, sources.body
    focal = HEIGHT / 2.0 / np.tan(FIELD_OF_VIEW / 2.0)
    middle = (WIDTH - 1) / 2.0, (HEIGHT - 1) / 2.0
    lens = CameraModel("outside", WIDTH, HEIGHT, focal, focal, *middle, (0.0,) * 5, "plumb_bob")
    path = motion.world_T_root[:, :2, 3]
    followed = uniform_filter1d(path, round(_FOLLOW_S * 1e9 / motion.frame_ns), axis=0, mode="nearest")
    first = motion.segments_at(body, 0)
    opening = OpeningView.of_body(first[body.segment_index[body.root]], points_to_see(body, first))
    for index, seconds in enumerate(motion.seconds.tolist()):
        moved = np.append(followed[index] - followed[0], 0.0)
        world_T_camera = looking_at(opening.position + moved, opening.look_at + moved)
        camera_T_world = inverse(world_T_camera)
        picture = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
        around = np.round(world_T_camera[:2, 3])
        for start, end in grid_lines(around - _REACH_M, around + _REACH_M):
            points = transform_points(camera_T_world, np.linspace(start, end, _STEPS))
            pixels = np.where(points[:, 2:] > _NEAREST_M, lens.project(points)[0], np.nan)
            draw_polyline(picture, pixels, GRID, 1, is_bgr=True)
        yield seconds, index, picture, world_T_camera, lens


def _over_images(sources: Sources, camera: str, solved: Path) -> Iterator[_Shot]:
    """A shot of every image of a camera that has a state."""
    motion, stations, recording = sources.motion, sources.stations, sources.recording
    if recording is None:
        raise ViewError(f"--over {shown(camera)}: give the bag with its images with --recording")
    if camera not in sources.cameras:
        raise ViewError(
            f"--over {shown(camera)}: is no camera that {recording} has images of; "
            f"{other_than(camera, sources.cameras)}"
        )
    clock = read_clock(solved, camera)
    with open_recording(recording) as bag:
        lens = stations[camera].camera if camera in stations else bag.camera_model(camera)
        for image in bag.images([camera]):
            stamps_ns = np.array([image.stamp_ns], np.int64)
            stamp_ns = int((stamps_ns if clock is None else clock.corrected_ns(stamps_ns))[0])
            index = nearest(motion.stamps_ns, stamp_ns, motion.frame_ns // 2)
            if index is None:
                continue
            if camera in stations:
                world_T_camera = stations[camera].world_T_camera
            else:
                world_T_camera = mounted_camera(sources.body, motion.segments_at(sources.body, index), camera)
            seconds = (stamp_ns - int(motion.stamps_ns[0])) * 1e-9
            yield seconds, index, np.ascontiguousarray(decode_colour(image)), world_T_camera, lens


def _write_time(picture: Image, seconds: float) -> None:
    corner, font = (12, picture.shape[0] - 14), cv2.FONT_HERSHEY_SIMPLEX
    for colour, width in (("#ffffff", 4), (INK, 1)):
        cv2.putText(picture, f"{seconds:.2f} s", corner, font, 0.6, rgb(colour)[::-1], width, cv2.LINE_AA)
