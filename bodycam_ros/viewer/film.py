"""The moving body as a video: from outside as the view opens, or over the images of a camera (A figures 1 and 8)."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d
from trimesh.remesh import subdivide_to_size

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_colour
from bodycam_ros.camera.perspective import PlumbBobCamera
from bodycam_ros.errors import ViewError
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.picture_style import EQUIPMENT, INK, QUIET, side_colour
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.video_encoder import video_writer
from bodycam_ros.results.body_motion import nearest
from bodycam_ros.results.topics import read_clock
from bodycam_ros.shown import shown
from bodycam_ros.static_cameras.surface import Surface
from bodycam_ros.static_cameras.surface_folder import surfaces_of
from bodycam_ros.viewer.camera_picture import draw_polyline
from bodycam_ros.viewer.motion import mounted_camera
from bodycam_ros.viewer.opening_view import FIELD_OF_VIEW, OpeningView, points_to_see
from bodycam_ros.viewer.scene import grid_lines
from bodycam_ros.viewer.scene_nodes import GRID, rgb
from bodycam_ros.viewer.sources import Sources
from bodycam_ros.viewer.surface_scene import with_closed_forearms
from bodycam_ros.whole_file import whole_file

Image = NDArray[np.uint8]

WIDTH, HEIGHT = 1280, 720
"""Of the video from outside [px]."""

_REACH_M = 10.0  # of the floor's grid, around the viewer
_STEPS = 80  # pieces of a grid line: those ahead of the viewer are drawn
_NEAREST_M = 0.1  # of what is drawn of the place
_POINT_PX = 2
_FADE = 0.55  # of a landmark's colour, towards white: the body stands out
_SHARP_PX = 720  # a camera's picture that is less high is magnified
_OVER_IMAGE = 0.5  # opacity of the body: the limbs in the image stay visible
_FOLLOW_S = 1.4  # the view from outside follows the mean of the root's path over this time

_LIGHT = np.array([-0.35, -0.75, -0.55]) / np.linalg.norm([-0.35, -0.75, -0.55])
"""Towards the light, in the camera's axes: above the viewer's left shoulder."""

_SHADE, _LIT = 0.55, 1.12  # brightness of a face turned from the light, and towards it
_FINER = 2  # pixels painted for each of the picture's, along one side: smooth edges
_LARGEST_M = 0.02  # side of a face: faces are sorted as a whole, which shows where segments run into each other
_MOUNT_M = 0.03  # a nearer face belongs to the camera's own mount, and would fill the picture
_LONGEST_PX = 400.0  # of a face's side: longer ones cross the rim of a fisheye's field
_FAR_PX = 8000.0  # OpenCV's coordinates are 32 bits


def write_film(sources: Sources, camera: str | None, path: Path, progress: Progress) -> None:
    """Write the video as MP4, whole or not at all.

    Args:
        sources: the body and how it moved.
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
    film = _Film(sources)
    pictures = film.from_outside() if camera is None else film.over(camera, sources.solved)
    rate_hz = 1e9 / sources.motion.frame_ns
    with (
        whole_file(path) as unfinished,
        progress.step(path.name, len(sources.motion.stamps_ns)) as advance,
        video_writer(unfinished, rate_hz) as write,
    ):
        is_empty = True
        for seconds, picture in pictures:
            _write_time(picture, seconds)
            write(seconds, picture)
            advance()
            is_empty = False
        if is_empty:
            raise ViewError(f"{sources.recording}: has no image of {camera} from the time that {sources.solved} has")


class _Film:
    def __init__(self, sources: Sources) -> None:
        self._sources, self._motion, self._body = sources, sources.motion, sources.body
        surfaces = surfaces_of(sources.body, sources.body_file.path, sources.surface)
        self._surfaces = {
            segment: Surface(segment, *subdivide_to_size(surface.vertices, surface.faces, _LARGEST_M))  # type: ignore[no-untyped-call]
            for segment, surface in with_closed_forearms(sources.body, surfaces).items()
        }

    def from_outside(self) -> Iterator[tuple[float, Image]]:
        """Seconds and picture of every state."""
        focal = HEIGHT / 2.0 / np.tan(FIELD_OF_VIEW / 2.0)
        lens = PlumbBobCamera("outside", WIDTH, HEIGHT, focal, focal, (WIDTH - 1) / 2.0, (HEIGHT - 1) / 2.0, (0.0,) * 5)
        path = self._motion.world_T_root[:, :2, 3]
        followed = uniform_filter1d(path, round(_FOLLOW_S * 1e9 / self._motion.frame_ns), axis=0, mode="nearest")
        first = self._motion.segments_at(self._body, 0)
        points = points_to_see(self._body, self._surfaces, first)
        opening = OpeningView.of_body(first[self._body.segment_index[self._body.root]], points)
        for instant, seconds in enumerate(self._motion.seconds.tolist()):
            moved = np.append(followed[instant] - followed[0], 0.0)
            world_T_camera = looking_at(opening.position + moved, opening.look_at + moved)
            picture = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
            self._draw_place(picture, lens, world_T_camera, path[: instant + 1])
            self._paint(picture, instant, world_T_camera, lens, 1.0)
            yield seconds, picture

    def over(self, camera: str, solved: Path) -> Iterator[tuple[float, Image]]:
        """Seconds and picture of every image of a camera that has a state."""
        recording, stations = self._sources.recording, self._sources.stations
        if recording is None:
            raise ViewError(f"--over {shown(camera)}: give the bag with its images with --recording")
        if camera not in self._sources.cameras:
            known = ", ".join(self._sources.cameras)
            raise ViewError(f"--over {shown(camera)}: is no camera that {recording} has images of; there are {known}")
        clock = read_clock(solved, camera)
        with open_recording(recording) as bag:
            lens = stations[camera].camera if camera in stations else bag.camera_model(camera)
            for image in bag.images([camera]):
                stamp_ns = image.stamp_ns
                if clock is not None:
                    stamp_ns = int(clock.corrected_ns(np.array([stamp_ns], dtype=np.int64))[0])
                instant = nearest(self._motion.stamps_ns, stamp_ns, self._motion.frame_ns // 2)
                if instant is None:
                    continue
                picture = np.ascontiguousarray(decode_colour(image))
                poses = self._motion.segments_at(self._body, instant)
                is_static = camera in stations
                pose = stations[camera].world_T_camera if is_static else mounted_camera(self._body, poses, camera)
                self._paint(picture, instant, pose, lens, _OVER_IMAGE)
                times = -(-_SHARP_PX // lens.height)
                large = cv2.resize(picture, None, fx=times, fy=times, interpolation=cv2.INTER_LINEAR)
                yield (stamp_ns - int(self._motion.stamps_ns[0])) * 1e-9, np.asarray(large, np.uint8)

    def _paint(self, picture: Image, instant: int, world_T_camera: Array, lens: CameraModel, opacity: float) -> None:
        poses = dict(zip(self._body.segments, self._motion.segments_at(self._body, instant), strict=True))
        paint_body(picture, self._surfaces, poses, world_T_camera, lens, opacity)
        for line in self._motion.equipment_at(instant):
            _draw_line(picture, lens, world_T_camera, np.concatenate([line.start, line.end]), EQUIPMENT, 3)

    def _draw_place(self, picture: Image, lens: CameraModel, world_T_camera: Array, path: Array) -> None:
        """Draw the floor, the landmarks, and the root's path (T, 2) over the floor so far [m]."""
        reference_map = self._sources.reference_map
        if reference_map is None or reference_map.gravity_aligned:
            around = np.round(world_T_camera[:2, 3])
            for start, end in grid_lines(around - _REACH_M, around + _REACH_M):
                _draw_line(picture, lens, world_T_camera, np.linspace(start, end, _STEPS), GRID, 1)
        if reference_map is not None:
            pixels = _ahead(lens, world_T_camera, reference_map.points_world)
            inside = ((pixels > 0.0) & (pixels < [lens.width, lens.height])).all(axis=1)
            colours = 255.0 - (1.0 - _FADE) * (255.0 - reference_map.colours[inside].astype(np.float64))
            for centre, colour in zip(
                pixels[inside].round().astype(int).tolist(), colours[:, ::-1].tolist(), strict=True
            ):
                cv2.circle(picture, centre, _POINT_PX, colour, cv2.FILLED, cv2.LINE_AA)
        _draw_line(picture, lens, world_T_camera, np.column_stack([path, np.zeros(len(path))]), QUIET, 2)


def _ahead(lens: CameraModel, world_T_camera: Array, points_world: Array) -> Array:
    """(N, 2) pixels of points (N, 3) [m]; NaN behind the camera and outside the lens."""
    points = transform_points(inverse(world_T_camera), points_world)
    pixels: Array = lens.project(points)[0].copy()
    pixels[points[:, 2] <= _NEAREST_M] = np.nan
    return pixels


def _draw_line(
    picture: Image, lens: CameraModel, world_T_camera: Array, points_world: Array, colour: str, width: int
) -> None:
    """Draw the pieces of a line (N, 3) [m] that are ahead of the camera."""
    draw_polyline(picture, _ahead(lens, world_T_camera, points_world), colour, width, is_bgr=True)


def paint_body(
    picture: Image,
    surfaces: Mapping[str, Surface],
    world_T_segment: Mapping[str, Array],
    world_T_camera: Array,
    lens: CameraModel,
    opacity: float = 1.0,
) -> None:
    """Paint a body over a picture (H, W, 3) of blue, green, red: its visible faces, the farthest first.

    Args:
        picture: that it is painted into.
        surfaces: segment -> its surface.
        world_T_segment: segment -> (4, 4) [m].
        world_T_camera: (4, 4) of the camera's optical frame [m].
        lens: of the camera.
        opacity: of the body: 1 hides what is behind it.
    """
    camera_T_world = inverse(world_T_camera)
    faces = [
        _faces(surface, camera_T_world @ world_T_segment[segment], lens, rgb(side_colour(segment))[::-1])
        for segment, surface in surfaces.items()
    ]
    corners, distances, colours = (np.concatenate(parts) for parts in zip(*faces, strict=True))
    painted = np.zeros((_FINER * picture.shape[0], _FINER * picture.shape[1], 4), np.uint8)
    order = np.argsort(-distances)
    for face, colour in zip(corners[order], colours[order].tolist(), strict=True):
        cv2.fillConvexPoly(painted, face, (*colour, 255.0))
    small = cv2.resize(painted, picture.shape[1::-1], interpolation=cv2.INTER_AREA).astype(np.float32)
    covered = small[:, :, 3:] / 255.0
    picture[:] = np.clip((1.0 - opacity * covered) * picture + opacity * small[:, :, :3], 0.0, 255.0).astype(np.uint8)


def _faces(
    surface: Surface, camera_T_segment: Array, lens: CameraModel, colour: tuple[int, ...]
) -> tuple[NDArray[np.int32], Array, Array]:
    """Corners (F, 3, 2) [finer px], distances (F,) [m] and colours (F, 3) of the faces of a surface in view."""
    facing = np.flatnonzero(surface.faces_towards(inverse(camera_T_segment)[:3, 3]))
    points = transform_points(camera_T_segment, surface.vertices)
    pixels = lens.project(points)[0][surface.faces[facing]]
    distances = np.linalg.norm(points, axis=1)[surface.faces[facing]]
    sides = np.linalg.norm(pixels - np.roll(pixels, 1, axis=1), axis=2).max(axis=1)
    # NaN, outside the lens, is in no range.
    is_shown = (sides < _LONGEST_PX) & (np.abs(pixels) < _FAR_PX).all(axis=(1, 2)) & (distances.min(axis=1) > _MOUNT_M)
    normals = surface.face_normals[facing[is_shown]] @ camera_T_segment[:3, :3].T
    brightness = _SHADE + (_LIT - _SHADE) * 0.5 * (1.0 + normals @ _LIGHT)
    corners = np.round((pixels[is_shown] + 0.5) * _FINER - 0.5).astype(np.int32)
    colours = np.clip(brightness[:, None] * np.array(colour), 0.0, 255.0)
    return corners, distances[is_shown].mean(axis=1), colours


def looking_at(position: Array, look_at: Array) -> Array:
    """(4, 4) pose of a camera's optical frame (x right, y down, z ahead) at a point (3,), z of the world up [m]."""
    ahead = (look_at - position) / np.linalg.norm(look_at - position)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    pose[:3, 3] = position
    return pose


def _write_time(picture: Image, seconds: float) -> None:
    corner, font = (12, picture.shape[0] - 14), cv2.FONT_HERSHEY_SIMPLEX
    for colour, width in (("#ffffff", 4), (INK, 1)):
        cv2.putText(picture, f"{seconds:.2f} s", corner, font, 0.6, rgb(colour)[::-1], width, cv2.LINE_AA)
