"""The moving body as a video: from outside as the view opens, or over what one camera saw (A figures 1 and 8)."""

from collections.abc import Iterator, Mapping
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import decode_colour
from bodycam_ros.camera.perspective import PlumbBobCamera
from bodycam_ros.errors import ViewError
from bodycam_ros.geometry import Array, inverse, transform_points
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.plots.picture_style import EQUIPMENT, INK, QUIET, side_colour
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.video_encoder import video_writer
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.body_motion import nearest
from bodycam_ros.results.topics import read_clock
from bodycam_ros.shown import shown
from bodycam_ros.static_cameras.surface import Surface
from bodycam_ros.static_cameras.surface_folder import surfaces_of
from bodycam_ros.viewer.opening_view import FIELD_OF_VIEW, OpeningView, points_to_see
from bodycam_ros.viewer.scene_nodes import GRID, rgb
from bodycam_ros.viewer.skeleton_scene import Image, paint_body
from bodycam_ros.viewer.sources import Sources
from bodycam_ros.viewer.surface_scene import hands_beyond
from bodycam_ros.whole_file import whole_file

_REACH_M = 10  # of the grid, around what is looked at
_STEP_M = 0.25  # lines are drawn in pieces: one that passes the viewer is not lost
_SHIFT = 4
_POINT_PX = 1.6
_FADE = 0.55  # of a landmark's colour, towards white: the body stands out


def draw_place(
    picture: Image, lens: CameraModel, world_T_camera: Array, reference_map: ReferenceMap | None, way: Array
) -> None:
    """Draw it into a picture (H, W, 3) of blue, green, red.

    Args:
        picture: drawn into.
        lens, world_T_camera: of the viewer.
        reference_map: the place; None where static cameras are all that is known of it.
        way: (T, 2) of the root over the floor so far [m].
    """
    camera_T_world = inverse(world_T_camera)
    if reference_map is None or reference_map.gravity_aligned:
        for line in _grid(world_T_camera[:2, 3]):
            _draw_line(picture, lens, camera_T_world, line, GRID, 1)
    if reference_map is not None:
        points = transform_points(camera_T_world, reference_map.points_world)
        pixels = lens.project(points)[0]
        inside = np.isfinite(pixels).all(axis=1) & (points[:, 2] > 0.0)
        inside[inside] &= ((pixels[inside] > 0.0) & (pixels[inside] < [lens.width, lens.height])).all(axis=1)
        colours = 255.0 - (1.0 - _FADE) * (255.0 - reference_map.colours[inside].astype(np.float64))
        centres = np.round(pixels[inside] * (1 << _SHIFT)).astype(int).tolist()
        for centre, colour in zip(centres, colours[:, ::-1].tolist(), strict=True):
            cv2.circle(picture, centre, round(_POINT_PX * (1 << _SHIFT)), colour, cv2.FILLED, cv2.LINE_AA, _SHIFT)
    _draw_line(picture, lens, camera_T_world, np.column_stack([way, np.zeros(len(way))]), QUIET, 2)


def _grid(around: Array) -> list[Array]:
    """Lines (N, 3) a metre apart on the floor."""
    x, y = np.round(around)
    along = np.arange(-_REACH_M, _REACH_M + _STEP_M, _STEP_M)
    lines = []
    for step in range(-_REACH_M, _REACH_M + 1):
        lines.append(np.column_stack([x + along, np.full(len(along), y + step), np.zeros(len(along))]))
        lines.append(np.column_stack([np.full(len(along), x + step), y + along, np.zeros(len(along))]))
    return lines


def _draw_line(
    picture: Image, lens: CameraModel, camera_T_world: Array, points_world: Array, colour: str, width: int
) -> None:
    """Draw the pieces (N, 3) of a line that are before the camera."""
    points = transform_points(camera_T_world, points_world)
    pixels = lens.project(points)[0]
    ahead = np.isfinite(pixels).all(axis=1) & (points[:, 2] > 0.1)
    pieces = np.stack([pixels[:-1], pixels[1:]], axis=1)[ahead[:-1] & ahead[1:]]
    pieces = pieces[(np.abs(pieces) < 1e4).all(axis=(1, 2))]
    fixed = list(np.round(pieces * (1 << _SHIFT)).astype(np.int32))
    cv2.polylines(picture, fixed, False, rgb(colour)[::-1], width, cv2.LINE_AA, _SHIFT)


WIDTH, HEIGHT = 1280, 720
"""Of the video from outside [px]."""

_SHARP_PX = 720  # a camera's picture that is less high is magnified
_OVER_IMAGE = 0.5  # opacity: what the camera saw of the limbs stays to be compared with
_UNHURRIED_S = 0.7  # the view from outside follows the body's way, not each step


def write_film(sources: Sources, camera: str | None, path: Path, progress: Progress) -> None:
    """Write the video as MP4, whole or not at all.

    Args:
        sources: the body and how it moved.
        camera: whose images are under the body; None: from outside.
        path: the file to write.
        progress: shown to a person.

    Raises:
        ViewError: there is no motion, or no image of the camera while it was solved.
        RecordingError: not a recording, or an image that cannot be decoded.
        OutputError: the video cannot be written.
    """
    if sources.solved is None:
        raise ViewError("-o: a body in its N-pose does not move; name OUT, a bag that 'bodycam replay' wrote")
    film = _Film(sources)
    pictures = film.from_outside() if camera is None else film.over(camera)
    count = len(sources.motion.stamps_ns)
    rate_hz = 1e9 / sources.motion.frame_ns
    with (
        whole_file(path) as unfinished,
        progress.step(path.name, count) as advance,
        video_writer(unfinished, rate_hz) as write,
    ):
        is_empty = True
        for seconds, picture in pictures:
            write(seconds, _with_time(picture, seconds))
            advance()
            is_empty = False
        if is_empty:
            raise ViewError(f"{sources.recording}: has no image of {camera} from the time that {sources.solved} has")


class _Film:
    def __init__(self, sources: Sources) -> None:
        self._sources, self._motion, self._body = sources, sources.motion, sources.body
        surfaces = dict(surfaces_of(sources.body, sources.body_file.path, sources.surface))
        self._surfaces: Mapping[str, Surface] = _with_closed_forearms(sources, surfaces)
        self._colours = {segment: rgb(side_colour(segment))[::-1] for segment in self._surfaces}

    def from_outside(self) -> Iterator[tuple[float, Image]]:
        """Seconds and picture of every instant."""
        focal = HEIGHT / 2.0 / np.tan(FIELD_OF_VIEW / 2.0)
        lens = PlumbBobCamera("outside", WIDTH, HEIGHT, focal, focal, (WIDTH - 1) / 2.0, (HEIGHT - 1) / 2.0, (0.0,) * 5)
        ways = self._motion.world_T_root[:, :2, 3]
        followed = _smoothed(ways, round(_UNHURRIED_S * 1e9 / self._motion.frame_ns))
        first = self._motion.segments_at(self._body, 0)
        points = points_to_see(self._body, self._surfaces, first)
        opening = OpeningView.of_body(first[self._body.segment_index[self._body.root]], points)
        for instant, (seconds, way) in enumerate(zip(self._motion.seconds.tolist(), followed, strict=True)):
            moved = np.append(way - followed[0], 0.0)
            world_T_camera = looking_at(opening.position + moved, opening.look_at + moved)
            picture = np.full((HEIGHT, WIDTH, 3), 255, np.uint8)
            draw_place(picture, lens, world_T_camera, self._sources.reference_map, ways[: instant + 1])
            self._paint(picture, instant, world_T_camera, lens, 1.0)
            yield seconds, picture

    def over(self, camera: str) -> Iterator[tuple[float, Image]]:
        """Seconds and picture of every image of a camera while the body is known."""
        recording, stations = self._sources.recording, self._sources.stations
        if recording is None:
            raise ViewError(f"--over {shown(camera)}: give the bag with its images with --recording")
        if camera not in self._sources.cameras:
            known = ", ".join(self._sources.cameras)
            raise ViewError(f"--over {shown(camera)}: is no camera that {recording} has images of; there are {known}")
        assert self._sources.solved is not None
        clock = read_clock(self._sources.solved, camera)
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
                self._paint(picture, instant, self._world_T_camera(camera, instant), lens, _OVER_IMAGE)
                times = -(-_SHARP_PX // lens.height)
                large = cv2.resize(picture, None, fx=times, fy=times, interpolation=cv2.INTER_LINEAR)
                yield (stamp_ns - int(self._motion.stamps_ns[0])) * 1e-9, np.asarray(large, np.uint8)

    def _world_T_camera(self, camera: str, instant: int) -> Array:
        if camera in self._sources.stations:
            return self._sources.stations[camera].world_T_camera
        mount = self._body.mounts[camera]
        poses = self._motion.segments_at(self._body, instant)
        world_T_camera: Array = poses[self._body.segment_index[mount.segment]] @ mount.segment_T_camera
        return world_T_camera

    def _paint(self, picture: Image, instant: int, world_T_camera: Array, lens: CameraModel, opacity: float) -> None:
        poses = dict(zip(self._body.segments, self._motion.segments_at(self._body, instant), strict=True))
        paint_body(picture, self._surfaces, poses, self._colours, world_T_camera, lens, opacity)
        for line in self._motion.equipment_at(instant):
            ends = transform_points(inverse(world_T_camera), np.concatenate([line.start, line.end]))
            pixels = lens.project(ends)[0]
            if np.isfinite(pixels).all() and (ends[:, 2] > 0.0).all():
                start, end = np.round(pixels).astype(int).tolist()
                cv2.line(picture, start, end, rgb(EQUIPMENT)[::-1], 3, cv2.LINE_AA)


def looking_at(position: Array, look_at: Array) -> Array:
    """(4, 4) pose of a camera's optical frame (x right, y down, z ahead) at a place whose up is z [m]."""
    ahead = (look_at - position) / np.linalg.norm(look_at - position)
    right = np.cross(ahead, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right)
    pose = np.eye(4)
    pose[:3, :3] = np.stack([right, np.cross(ahead, right), ahead], axis=1)
    pose[:3, 3] = position
    return pose


def _with_closed_forearms(sources: Sources, surfaces: dict[str, Surface]) -> dict[str, Surface]:
    """Surfaces with stretched hands on forearms whose hands nobody followed, as the view shows them."""
    for forearm, hand in hands_beyond(sources.body, surfaces):
        arm = surfaces[forearm]
        vertices = np.concatenate([arm.vertices, hand.vertices])
        faces = np.concatenate([arm.faces, hand.faces + len(arm.vertices)]).astype(np.int32)
        surfaces[forearm] = Surface(forearm, vertices, faces)
    return surfaces


def _smoothed(ways: Array, half: int) -> Array:
    """Means (T, 2) over so many instants before and after, fewer at the ends."""
    total = np.concatenate([np.zeros((1, 2)), ways.cumsum(axis=0)])
    rows = np.arange(len(ways))
    reach = np.minimum(half, np.minimum(rows, len(ways) - 1 - rows))  # alike on both sides: the ends do not lag
    means: Array = (total[rows + reach + 1] - total[rows - reach]) / (2 * reach + 1)[:, None]
    return means


def _with_time(picture: Image, seconds: float) -> NDArray[np.uint8]:
    at, size = (12, picture.shape[0] - 14), 0.6
    for colour, width in (("#ffffff", 4), (INK, 1)):
        cv2.putText(
            picture, f"{seconds:.2f} s", at, cv2.FONT_HERSHEY_SIMPLEX, size, rgb(colour)[::-1], width, cv2.LINE_AA
        )
    return picture
