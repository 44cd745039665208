"""A film of a solved body, or one picture of it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from bodycam_ros.body.surface_folder import read_surfaces
from bodycam_ros.environment.environment import Environment
from bodycam_ros.environment.placement import Route, heading_of, placement, rolled
from bodycam_ros.errors import BodyError, OutputError, ViewError
from bodycam_ros.files.shown import shown
from bodycam_ros.files.whole_file import whole_file
from bodycam_ros.film.character import Character, PosedMesh
from bodycam_ros.film.frames import EvenFrames, Frames, RecordedFrames
from bodycam_ros.film.picture import Image, PictureMaker
from bodycam_ros.film.place import Place
from bodycam_ros.film.shots import (
    CAMERA,
    PHOTOGRAPH,
    CameraShots,
    OutsideShots,
    PhotographShots,
    Shots,
    letterboxed,
    split_view,
)
from bodycam_ros.film.views import OUTSIDE, UP
from bodycam_ros.formats.static_cameras_file import read_static_cameras
from bodycam_ros.geometry import Array
from bodycam_ros.progress import Progress
from bodycam_ros.recording.time_span import TimeSpan
from bodycam_ros.recording.video_encoder import video_writer
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.body_motion import interpolated, nearest_rows
from bodycam_ros.results.solved_body import SolvedBody, read_solved_body
from bodycam_ros.results.solved_part import part_of

PICTURES = (".png", ".jpg")
"""Endings of a file that one picture is written to, that of the first time."""


@dataclass(frozen=True)
class FilmRequest:
    """What to film.

    Attributes:
        solved: the bag that a replay wrote.
        view: one of ``OUTSIDE``, ``camera:NAME`` or ``photo:NAME``.
        map_path: of the place.
        recording: bag with the images of cameras.
        static_cameras: their file.
        photographs: folder of the map's photographs as they were taken; without it, as small as the map has them.
        beside: the camera whose images are shown beside the film.
        size: width and height [px].
        rate_hz: frames a second, where they are not those of a camera.
        span: part of the recording.
        environment: in place of what was there; only of views from outside.
        surface: folder with a scan of the person.
    """

    solved: Path
    view: str
    map_path: Path | None = None
    recording: Path | None = None
    static_cameras: Path | None = None
    photographs: Path | None = None
    beside: str | None = None
    size: tuple[int, int] = (1920, 1080)
    rate_hz: float = 30.0
    span: TimeSpan = TimeSpan()
    environment: Environment | None = None
    surface: Path | None = None


def write_film(request: FilmRequest, path: Path, progress: Progress, note: Callable[[str], None]) -> int:
    """Write a film as MP4 (H.264), or one picture as PNG or JPEG, whole or not at all; return the number of frames.

    Args:
        request: what to film.
        path: the file to write.
        progress: of the frames.
        note: is called with a sentence on what is left out of the film.

    Raises:
        ViewError: the view is unknown, or lacks what it is seen by.
        RecordingError, MapError, BodyError: a file is damaged, or does not fit the others.
        OutputError: the film cannot be written.
    """
    solved = part_of(read_solved_body(request.solved), request.span)
    reference_map = None if request.map_path is None else ReferenceMap.load(request.map_path)
    kind, name = split_view(request.view)
    if request.environment is not None and kind not in OUTSIDE:
        raise ViewError(
            f"--environment: --view {request.view} shows the place that was there; choose {', '.join(OUTSIDE)}"
        )
    frames = _frames(request, solved, kind, name)
    environment = request.environment
    motion = FilmedMotion(solved, frames, progress, request.surface)
    place = Place.around(reference_map, motion.boxes[:, 0, 2])
    up = UP
    if environment is not None:
        place = motion.move_into(environment)
        assert place.route is not None
        up = place.route.up
    width, height = request.size
    size = (width // 2, height) if request.beside is not None else (width, height)
    shots: Shots
    if kind in OUTSIDE:
        shots = OutsideShots(kind, motion.seconds, motion.facing, motion.boxes, size, up)
    elif kind == PHOTOGRAPH:
        shots = PhotographShots(name, request.map_path, reference_map, request.photographs, size)
    else:
        assert isinstance(frames, RecordedFrames)
        stations = {} if request.static_cameras is None else read_static_cameras(request.static_cameras, reference_map)
        shots = CameraShots(frames, solved, motion.world_T_segment, stations.get(name), size)
    maker = PictureMaker(shots.lens, shots.window, place)
    # In a camera's images the person has a shadow already.
    hides = kind not in OUTSIDE and maker.is_dense(shots.pose(0))
    if kind not in OUTSIDE and not hides:
        seen = (
            "without --map it is unknown" if reference_map is None else "the map has too few points in this view to say"
        )
        note(f"{seen} what is before the person: nothing hides the person")
    is_picture = path.suffix.lower() in PICTURES
    count = 1 if is_picture else len(frames.stamps_ns)
    with (
        whole_file(path) as unfinished,
        progress.step(path.name, count) as advance,
        _picture_writer(unfinished) if is_picture else video_writer(unfinished, frames.rate_hz) as write,
    ):
        for row, image in zip(range(count), frames.images(), strict=False):
            picture = maker.draw(
                motion.mesh(row),
                shots.pose(row),
                shots.background(image),
                hidden=hides,
                shaded=kind != CAMERA,
                bands=shots.bands(row, motion),
            )
            if request.beside is not None and image is not None:
                picture = np.hstack([picture, letterboxed(image, (width - size[0], height))])
            write(float(motion.seconds[row]), picture)
            advance()
    return count


class FilmedMotion:
    """The person at the frames of a film.

    Attributes:
        seconds: (F,) since the first frame.
        world_T_segment: (F, S, 4, 4) [m].
        facing: (3,) where the person faces, over all frames.
        heading: (3,) unit, level: where it goes.
        boxes: (F, 2, 3) corners of a box around the person [m].
    """

    def __init__(
        self, solved: SolvedBody, frames: Frames, progress: Progress | None = None, surface: Path | None = None
    ) -> None:
        self._solved, self._body, self._stamps_ns = solved, solved.body, frames.stamps_ns
        known = solved.equipment
        lengths = {} if known is None else dict(zip(known.lengths, known.values.tolist(), strict=True))
        scanned = None if surface is None else read_surfaces(surface, solved.body)
        try:
            self._character = Character(solved.body, lengths, scanned)
        except BodyError as error:
            raise BodyError(f"{surface or solved.path}: {error}") from error
        stamps_ns = frames.stamps_ns
        self.seconds: Array = (stamps_ns - stamps_ns[0]) * 1e-9
        poses = np.moveaxis(solved.world_T_segment, 1, 0)
        at = [interpolated(solved.stamps_ns, each, stamps_ns) if len(solved.stamps_ns) > 1 else each for each in poses]
        self.world_T_segment: Array = np.stack(at, axis=1)
        self._placed = (
            solved.placed[nearest_rows(solved.stamps_ns, stamps_ns)] if len(solved.stamps_ns) > 1 else solved.placed
        )
        roots = self.world_T_segment[:, solved.body.segment_index[solved.body.root]]
        self.facing: Array = roots[:, :3, 0].mean(axis=0)
        self.heading = heading_of(solved.body, self.world_T_segment)
        self._rolled = rolled(solved.body, self.world_T_segment, np.zeros(len(stamps_ns)))
        step: Any = nullcontext(int) if progress is None else progress.step("way of the person", len(stamps_ns))
        with step as advance:
            self.boxes: Array = np.array([self._box(row, advance) for row in range(len(stamps_ns))])

    def move_into(self, environment: Environment) -> Place:
        """Move the person into an environment (see ``placement``), and give the place."""
        lowest = self.boxes[:, 0, 2]
        placed = placement(environment, self.seconds, lowest, self.heading)
        self._rolled = rolled(self._body, self.world_T_segment, placed.travelled)
        self.world_T_segment[..., :3, 3] += placed.moved[:, None]
        self.boxes += placed.moved[:, None]
        route = Route(environment, self.boxes[0].mean(axis=0), self.heading, placed.ground_m)
        return Place(placed.ground_m, np.zeros((0, 3)), np.zeros((0, 3), np.uint8), None, route, route.scenery)

    def mesh(self, row: int) -> PosedMesh:
        """The person, with equipment where its pose is known, at a frame."""
        placed, rolled_m = bool(self._placed[row]), float(self._rolled[row])
        return self._character.posed(self.world_T_segment[row], with_equipment=placed, rolled_m=rolled_m)

    def near(self, row: int, offset_s: float) -> tuple[Array, PosedMesh]:
        """Poses (S, 4, 4) [m] at a time after a frame [s], and the mesh of the person."""
        poses = self._solved.segments_near(int(self._stamps_ns[row]) + round(1e9 * offset_s))
        placed, rolled_m = bool(self._placed[row]), float(self._rolled[row])
        return poses, self._character.posed(poses, with_equipment=placed, rolled_m=rolled_m)

    def _box(self, row: int, advance: Callable[[], object]) -> Array:
        advance()
        vertices = self.mesh(row).vertices
        return np.stack([vertices.min(axis=0), vertices.max(axis=0)])


def _frames(request: FilmRequest, solved: SolvedBody, kind: str, name: str) -> Frames:
    if kind == CAMERA:
        if request.beside not in (None, name):
            raise ViewError(
                f"--beside {shown(request.beside)}: beside the view of {name} only its own images can be shown; leave "
                "it out, or choose a view from outside"
            )
        return RecordedFrames(request.recording, solved, name, f"--view {request.view}")
    if request.beside is not None:
        return RecordedFrames(request.recording, solved, request.beside, f"--beside {request.beside}")
    return EvenFrames(solved, request.rate_hz)


@contextmanager
def _picture_writer(path: Path) -> Iterator[Callable[[float, Image], None]]:
    def write(seconds: float, picture: Image) -> None:
        done, data = cv2.imencode(path.suffix, picture)
        if not done:
            raise OutputError(f"{path}: the picture cannot be encoded")
        path.write_bytes(data.tobytes())

    yield write
