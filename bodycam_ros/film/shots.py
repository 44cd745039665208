"""How each view of a film gives its lens, its poses and what is behind the person."""

from itertools import pairwise
from pathlib import Path
from typing import Protocol

import cv2
import numpy as np

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import read_image_file
from bodycam_ros.errors import MapError, ViewError
from bodycam_ros.files.shown import other_than, shown
from bodycam_ros.film.character import PosedMesh
from bodycam_ros.film.frames import RecordedFrames
from bodycam_ros.film.picture import Band, Image
from bodycam_ros.film.views import OUTSIDE, UP, Window, fitted_lens, fitted_window, outside_lens, outside_poses
from bodycam_ros.geometry import Array
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.solved_body import SolvedBody
from bodycam_ros.static_cameras.static_camera import StaticCamera

CAMERA, PHOTOGRAPH = "camera", "photo"

_BANDS = 12  # of an image whose rows are read out one after the other


class Moments(Protocol):
    """A motion at times near the frames of a film."""

    def near(self, row: int, offset_s: float) -> tuple[Array, PosedMesh]:
        """Poses (S, 4, 4) [m] at a time after a frame [s], and the mesh of the person."""


class Shots(Protocol):
    """A view: ``lens`` is that of the film's pictures, ``window`` the part of them that has a camera's image."""

    lens: CameraModel
    window: Window

    def pose(self, row: int) -> Array:
        """world_T_camera (4, 4) at a frame [m]."""

    def bands(self, row: int, moments: Moments) -> list[Band]:
        """Rows of a frame that were exposed together, with the person then; none where all rows were."""

    def background(self, image: Image | None) -> Image | None:
        """Pixels (H, W, 3) behind the person, of the size of the lens, by the frame's image; None: the place."""


def split_view(view: str) -> tuple[str, str]:
    """Kind and name of a view.

    Raises:
        ViewError: there is none of this kind.
    """
    kind, _, name = view.partition(":")
    if (view in OUTSIDE) or (kind in (CAMERA, PHOTOGRAPH) and name):
        return kind, name
    raise ViewError(
        f"--view {shown(view)}: expected {', '.join(OUTSIDE)}, camera:NAME (a camera of the body, or a static one) or "
        "photo:NAME (a photograph of the map)"
    )


class OutsideShots:
    """A view from outside; see ``outside_poses``."""

    def __init__(
        self, kind: str, seconds: Array, heading: Array, boxes: Array, size: tuple[int, int], up: Array = UP
    ) -> None:
        self.lens, self.window = outside_lens(*size), (0, 0, *size)
        low, high = boxes[:, 0], boxes[:, 1]
        self._poses = outside_poses(kind, seconds, heading, low, high, size[0] / size[1], up)

    def pose(self, row: int) -> Array:
        """See ``Shots``."""
        return np.asarray(self._poses[row])

    def bands(self, row: int, moments: Moments) -> list[Band]:
        """No bands: all of a picture is of one time."""
        return []

    def background(self, image: Image | None) -> None:
        """None: the place is drawn."""


class CameraShots:
    """The view of a camera of the body, or of a static one, over its images.

    Raises:
        ViewError: the body has no such camera, and no static one is given.
    """

    def __init__(
        self,
        frames: RecordedFrames,
        solved: SolvedBody,
        world_T_segment: Array,
        station: StaticCamera | None,
        size: tuple[int, int],
    ) -> None:
        mount = solved.body.mounts.get(frames.camera)
        if station is not None:
            lens = station.camera
            self._readout_s = 0.0
            self._poses = np.broadcast_to(station.world_T_camera, (len(world_T_segment), 4, 4))
        elif mount is not None:
            lens = frames.lens
            self._readout_s, self._segment_T_camera = frames.readout_s, mount.segment_T_camera
            self._row_of = solved.body.segment_index[mount.segment]
            self._poses = world_T_segment[:, solved.body.segment_index[mount.segment]] @ mount.segment_T_camera
        else:
            raise ViewError(
                f"--view camera:{shown(frames.camera)}: is no camera of the body; "
                f"{other_than(frames.camera, [*solved.body.mounts])}; of a static camera give the file with --stations"
            )
        self._size = size
        self.lens, self.window = fitted_lens(lens, size), fitted_window(lens.width, lens.height, size)

    def pose(self, row: int) -> Array:
        """See ``Shots``."""
        return np.asarray(self._poses[row])

    def bands(self, row: int, moments: Moments) -> list[Band]:
        """Rows that were read out together; the frame's time is that of the middle row."""
        _, top, _, height = self.window
        if self._readout_s == 0.0:
            return []
        edges = np.round(top + np.linspace(0.0, 1.0, _BANDS + 1) * height).astype(int).tolist()
        made = []
        for number, (first, last) in enumerate(pairwise(edges)):
            poses, mesh = moments.near(row, self._readout_s * ((number + 0.5) / _BANDS - 0.5))
            made.append(Band(first, last, mesh, poses[self._row_of] @ self._segment_T_camera))
        return made

    def background(self, image: Image | None) -> Image:
        """The camera's image, fitted into the film."""
        assert image is not None, "the frames are the camera's images"
        return letterboxed(image, self._size)


class PhotographShots:
    """The view of a photograph of the map.

    Raises:
        ViewError: no map is given, it has no photographs, or none of this name.
        MapError: the photograph is damaged.
    """

    def __init__(
        self,
        name: str,
        map_path: Path | None,
        reference_map: ReferenceMap | None,
        folder: Path | None,
        size: tuple[int, int],
    ) -> None:
        if reference_map is None:
            raise ViewError(f"--view photo:{shown(name)}: give the map that it is of with --map")
        if reference_map.photographs is None:
            raise ViewError(f"--view photo:{shown(name)}: {map_path} was made without photographs; build it again")
        names = reference_map.image_names
        rows = [row for row, each in enumerate(names) if name in (each, Path(each).stem)]
        if not rows:
            raise ViewError(f"--view photo:{shown(name)}: is no photograph of {map_path}; {other_than(name, names)}")
        photographs = reference_map.photographs
        self._pose = reference_map.world_T_camera[rows[0]]
        if folder is None:
            picture, place = cv2.cvtColor(photographs.picture(rows[0], names[rows[0]]), cv2.COLOR_GRAY2BGR), map_path
        else:
            place = folder / names[rows[0]]
            picture = read_image_file(place, cv2.IMREAD_COLOR, MapError)
        lens = photographs.camera(rows[0])
        if abs(picture.shape[1] * lens.height - picture.shape[0] * lens.width) > 2 * max(picture.shape):
            raise MapError(
                f"{place}: has {picture.shape[1]} x {picture.shape[0]} pixels, another shape than in the map"
            )
        self.lens, self.window = fitted_lens(lens, size), fitted_window(lens.width, lens.height, size)
        self._picture = letterboxed(np.asarray(picture, np.uint8), size)

    def pose(self, row: int) -> Array:
        """See ``Shots``."""
        return np.asarray(self._pose)

    def bands(self, row: int, moments: Moments) -> list[Band]:
        """No bands: nothing moved in a photograph of the place."""
        return []

    def background(self, image: Image | None) -> Image:
        """The photograph, fitted into the film."""
        return self._picture


def letterboxed(image: Image, size: tuple[int, int]) -> Image:
    """An image in its window of a picture of a size (width, height) [px], dark around it; see ``fitted_window``."""
    left, top, width, height = fitted_window(image.shape[1], image.shape[0], size)
    picture = np.full((size[1], size[0], 3), _BAR, np.uint8)
    way = cv2.INTER_AREA if width < image.shape[1] else cv2.INTER_CUBIC
    picture[top : top + height, left : left + width] = cv2.resize(image, (width, height), interpolation=way)
    return picture


_BAR = 24
"""Brightness beside an image of another shape."""
