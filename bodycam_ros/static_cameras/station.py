"""A static camera, and the colours of a body's segments in its images."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.kernels import as_rows
from bodycam_ros.static_cameras.body_shape import BodySurface
from bodycam_ros.static_cameras.contour_kernels import NOBODY, carry_contour, find_contour
from bodycam_ros.static_cameras.region_kernels import (
    COLOURS,
    count_areas,
    count_colours,
    line_shifts,
    measure_lines,
    segment_energies,
)
from bodycam_ros.static_cameras.region_settings import LEAST_SIGMA_PX


@dataclass(frozen=True, eq=False)
class Station:
    """A static camera.

    Attributes:
        name: of the camera, and of its topics.
        world_T_camera: (4, 4) its optical frame in the world [m].
        camera: its lens.
    """

    name: str
    world_T_camera: Array
    camera: CameraModel

    def check_size(self, image: NDArray[np.uint8]) -> None:
        """Refuse an image of another size than the lens is for.

        Raises:
            RecordingError: it is.
        """
        if image.shape[:2] != (self.camera.height, self.camera.width):
            raise RecordingError(
                f"camera {self.name}: an image of {image.shape[1]}x{image.shape[0]} px; cameras.yaml says that the "
                f"lens is for {self.camera.width}x{self.camera.height}"
            )


_SHRINK = 2  # pixels of the image that are one of the picture of who is in front
_LINE_SPACING_PX = 6.0  # from line to line along a contour; neighbours measure the same
_INWARD_PX, _OUTWARD_PX = 12, 20  # from a contour, in which colours of the segment and beside it are counted
_CARRIED_PX = 4.0  # that no point of a contour is carried on from where it was found
_MOST_POINTS = 6000
_UNSEEN = 1e-4  # likelihood of a colour that was never seen: noise, and what stands before the background for a moment
_ALIKE = 0.5  # Bhattacharyya coefficient from which on the colours of two segments are one
_LEAST_PIXELS = 30.0  # that make a statistic

Image = NDArray[np.uint8]
Counts = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Contour:
    """Where lines across the contours of a body are.

    Attributes:
        points, segments: (N, POINT), (N,) of ``find_contour``.
        labels: which segment was in front where they were found, at a part of the image's resolution.
    """

    points: Array
    segments: NDArray[np.int64]
    labels: Image


@dataclass(frozen=True, eq=False)
class MeasuredContour:
    """N points along the visible contours of all segments.

    Attributes:
        pixels: (N, 2) where they are.
        normals: (N, 2) unit vectors away from their segments, in the image.
        segments: (N,) whose they are.
        shifts: (N,) how far along its normal the image would rather have each [px]; NaN where it cannot tell.
        labels: (h, w) the segment that is in front, at a part of the image's resolution; ``NOBODY`` beside the body.
        shrink: pixels of the image, across, that are one of the labels.
    """

    pixels: Array
    normals: Array
    segments: NDArray[np.int64]
    shifts: Array
    labels: NDArray[np.uint8]
    shrink: int

    @property
    def covered(self) -> Array | None:
        """(2, 2) least and greatest pixel that shows the body; None where none does."""
        rows, columns = np.nonzero(self.labels != NOBODY)
        if not len(rows):
            return None
        least = np.array([columns.min(), rows.min()], np.float64)
        return self.shrink * np.stack([least, np.array([columns.max() + 1, rows.max() + 1])])


@dataclass(frozen=True, eq=False)
class RegionEvidence:
    """Normal equations of an image for a change of world_T_segment, in the segments' axes, rotation first.

    Attributes:
        information: (S, 6, 6), every line by itself.
        vector: (S, 6).
        lines: (S,) lines that measure something.
        asked: (S,) lines across the visible contour.
    """

    information: Array
    vector: Array
    lines: NDArray[np.int64]
    asked: NDArray[np.int64]

    @property
    def confidence(self) -> Array:
        """(S,) share of the lines that measure something; 0 where there are none."""
        share: Array = self.lines / np.maximum(self.asked, 1)
        return share


class RegionModel:
    """Colours of segments, and of what is beside them, in the images of one static camera.

    Args:
        station: its pose and lens.
        surface: of the body.
        jointed: (S, S) which segments a joint connects.

    Attributes:
        areas: (S, COLOURS) share of each colour where a segment is in front; zero while it has not been.
    """

    def __init__(self, station: Station, surface: BodySurface, jointed: NDArray[np.bool_]) -> None:
        self.station = station
        self._surface = surface
        self._jointed = jointed
        self._stands_out = np.zeros(jointed.shape, np.uint8)
        self._camera_T_world = inverse(station.world_T_camera)
        self._lens = station.camera.parameters
        self._inside, self._outside, self.areas, self._log_odds = (
            np.zeros((surface.segment_count, COLOURS), np.float32) for _ in range(4)
        )

    @property
    def has_colours(self) -> NDArray[np.bool_]:
        """(S,) segments with known colours on both sides of the contour."""
        known: NDArray[np.bool_] = np.logical_and(self._inside.any(axis=1), self._outside.any(axis=1))
        return known

    def find_contour(self, world_T_segment: Array) -> Contour:
        """The visible contours of a body at poses (S, 4, 4)."""
        of, camera = self._surface, self.station.camera
        return Contour(
            *find_contour(
                self._lens,
                as_rows(self._camera_T_world @ world_T_segment),
                of.vertices,
                of.segment_of_vertex,
                of.faces,
                of.face_normals,
                of.face_offsets,
                of.segment_of_face,
                of.edges,
                of.edge_faces,
                self._stands_out,
                camera.width,
                camera.height,
                _SHRINK,
                _LINE_SPACING_PX,
                _MOST_POINTS,
            )
        )

    def propagate_contour(self, contour: Contour, world_T_segment: Array) -> Contour:
        """A contour of a body that has since moved to poses (S, 4, 4): quicker, and as good unless it has moved far."""
        camera_T_segment = as_rows(self._camera_T_world @ world_T_segment)
        points, segments = carry_contour(self._lens, camera_T_segment, contour.points, contour.segments)
        if np.abs(points[:, :2] - points[:, 10:12]).max(initial=0.0) > _CARRIED_PX:
            return self.find_contour(world_T_segment)
        return Contour(points, segments, contour.labels)

    def measure(self, image: Image, contour: Contour, stride: int) -> RegionEvidence:
        """Measure lines across the contours of a body, ``stride`` pixels a sample."""
        points, segments, labels = contour.points, contour.segments, contour.labels
        least_px = LEAST_SIGMA_PX * stride
        measured = measure_lines(
            image, labels, _SHRINK, points, segments, self._stands_out, self._log_odds, stride, least_px
        )
        return RegionEvidence(*measured, np.bincount(segments, minlength=self._surface.segment_count))

    def energies(self, image: Image, contour: Contour) -> tuple[Array, NDArray[np.int64]]:
        """How many pixels (S,) the segments of a body explain better than no body does (B eq. 8).

        Those that they explain worse are subtracted. The second value is how many pixels (S,) each has.
        """
        return segment_energies(image, contour.labels, _SHRINK, self._log_odds)

    def copy_unknown_colours(self, others: Iterable["RegionModel"]) -> None:
        """Take unknown colours from other cameras: clothes look alike from all sides."""
        rows = np.flatnonzero(~self.areas.any(axis=1))
        shared = sum((other.areas[rows] for other in others), np.zeros((len(rows), COLOURS), np.float32))
        rows, shared = rows[shared.any(axis=1)], shared[shared.any(axis=1)]
        if not len(rows):
            return
        self.areas[rows] = self._inside[rows] = shared / shared.sum(axis=1, keepdims=True)
        self._log_odds[rows] = np.log((self._inside[rows] + _UNSEEN) / (self._outside[rows] + _UNSEEN))
        self._stands_out = self._differing()

    def reset_colours(self) -> None:
        """Remove all colours."""
        for known in (self._inside, self._outside, self.areas, self._log_odds):
            known[:] = 0.0

    def copy_colours(self, source: Mapping[int, int]) -> None:
        """Copy the colours of segments: row -> row that has them."""
        for row, alike in source.items():
            for known in (self._inside, self._outside, self.areas, self._log_odds):
                known[row] = known[alike]
        self._stands_out = self._differing()

    def update_colours(self, image: Image, contour: Contour, rate: float, which: NDArray[np.bool_]) -> None:
        """Update the colours of some segments (S,) along their contours; unknown ones are taken at once."""
        inside, outside = count_colours(
            image, contour.labels, _SHRINK, contour.points, contour.segments, self._stands_out, _INWARD_PX, _OUTWARD_PX
        )
        areas = count_areas(image, contour.labels, _SHRINK, len(which))
        # Of a segment that is in front of others alike, no line says what is inside.
        inside = np.where(inside.sum(axis=1, keepdims=True) > _LEAST_PIXELS, inside, areas)
        for known, counts in ((self._inside, inside), (self._outside, outside), (self.areas, areas)):
            self._blend(known, counts, rate, which)
        np.log((self._inside + _UNSEEN) / (self._outside + _UNSEEN), out=self._log_odds)
        self._stands_out = self._differing()

    def measured_contour(self, image: Image, contour: Contour) -> MeasuredContour:
        """Visible contours of a body, and their shifts by the known colours."""
        points, segments, labels = contour.points, contour.segments, contour.labels
        shifts = self.line_shifts(image, contour)[0]
        return MeasuredContour(points[:, :2], points[:, 2:4], segments, shifts, labels, _SHRINK)

    def line_shifts(self, image: Image, contour: Contour) -> tuple[Array, Array]:
        """How far outward (N,) of its points a contour is [px], NaN where nothing tells, and variances (N,) [px^2]."""
        points, segments, labels = contour.points, contour.segments, contour.labels
        return line_shifts(image, labels, _SHRINK, points, segments, self._stands_out, self._log_odds, 1)

    @staticmethod
    def _blend(known: Counts, counts: Counts, rate: float, which: NDArray[np.bool_]) -> None:
        """Let what is known (S, COLOURS) of some segments follow what is counted; what is new is taken as it is."""
        total = counts.sum(axis=1, keepdims=True)
        share = counts / np.maximum(total, 1.0)
        fresh = known.sum(axis=1, keepdims=True) == 0.0
        share -= known
        share *= np.where(which[:, None] & (total > _LEAST_PIXELS), np.where(fresh, 1.0, rate), 0.0).astype(np.float32)
        known += share

    def _differing(self) -> NDArray[np.uint8]:
        """(S, S) which segments have other colours than each other; those that a joint ties have no border."""
        roots = np.sqrt(self.areas)
        known = self.areas.sum(axis=1) > 0.0
        differs = (roots @ roots.T < _ALIKE) & np.outer(known, known)
        return np.ascontiguousarray(differs & ~self._jointed, np.uint8)


_LEAST_COUNTED = 60  # smallest number of labels to judge a segment by
_LOST_SHARE = 0.25  # of what it usually explains: a segment beside itself shows the background
_LEARNING = 0.1  # share of a frame in what is usual
_PATIENCE = 3  # frames in a row: a blurred limb recovers by itself
_PAUSE = 30  # frames between two searches; twice as many after each failure

Mask = NDArray[np.bool_]


class LossDetector:
    """Detects lost segments: each is compared with how well it usually explains its pixels.

    Args:
        segment_count: S.

    Attributes:
        should_search: whether a segment has been lost for long enough, and no search was made recently.
    """

    def __init__(self, segment_count: int) -> None:
        self._usual = np.full(segment_count, np.nan)
        self._lost_for = np.zeros(segment_count, np.int64)
        self._since_search = self._pause = _PAUSE
        self.should_search = False

    def lost(self, energies: Array, pixels: NDArray[np.int64]) -> Mask:
        """Lost segments (S,), by the pixels that they explain (S,) of their pixels (S,)."""
        enough = pixels >= _LEAST_COUNTED
        share = energies / np.maximum(pixels, 1)
        first = enough & np.isnan(self._usual) & (share > 0.0)
        self._usual[first] = share[first]
        lost: Mask = enough & (share < _LOST_SHARE * self._usual)
        fine = enough & ~lost
        self._usual[fine] += _LEARNING * (share[fine] - self._usual[fine])
        self._lost_for = np.where(lost, self._lost_for + 1, 0)
        self._since_search += 1
        if not lost.any():
            self._pause = _PAUSE
        self.should_search = bool((self._lost_for >= _PATIENCE).any()) and self._since_search > self._pause
        if self.should_search:
            self._since_search, self._pause = 0, 2 * self._pause
        return lost
