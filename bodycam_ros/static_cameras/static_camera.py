"""A static camera, and the colours of a body's segments in its images."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.surface import NOBODY, BodySurface
from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array, inverse
from bodycam_ros.kernels import as_rows
from bodycam_ros.static_cameras.contour_kernels import carry_contour, find_contour
from bodycam_ros.static_cameras.region_kernels import BINS, COLOURS, count_colours, measure_lines
from bodycam_ros.static_cameras.region_settings import LEAST_SIGMA_PX

SHRINK = 2
"""Pixels of the image, across, that are one of the labels."""

_LINE_SPACING_PX = 6.0  # from line to line along a contour; neighbours measure the same
_INWARD_PX, _OUTWARD_PX = 12, 20  # from a contour, in which colours of the segment and beside it are counted
_CARRIED_PX = 4.0  # largest shift of a contour point from where it was found
_MOST_POINTS = 6000
_UNSEEN = 1e-4  # likelihood of a colour that was never counted: noise, and what passes before the background
_ALIKE = 0.5  # Bhattacharyya coefficient from which on the colours of two segments are one
_LEAST_PIXELS = 30.0  # that make a statistic

Image = NDArray[np.uint8]
Mask = NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class StaticCamera:
    """A static camera.

    Attributes:
        name: of the camera, and of its topics.
        world_T_camera: (4, 4) its optical frame in the world [m].
        camera: its lens.
    """

    name: str
    world_T_camera: Array
    camera: CameraModel

    def check_size(self, image: Image) -> None:
        """Refuse an image of another size than the lens is for.

        Raises:
            RecordingError: it is.
        """
        if image.shape[:2] != (self.camera.height, self.camera.width):
            raise RecordingError(
                f"camera {self.name}: an image of {image.shape[1]}x{image.shape[0]} px; cameras.yaml says that the "
                f"lens is for {self.camera.width}x{self.camera.height}"
            )


@dataclass(frozen=True, eq=False)
class Contour:
    """N points along the visible contours of all segments; a line runs across each.

    Attributes:
        points, segments: (N, POINT), (N,) of ``find_contour``.
        labels: (h, w) the segment that is in front where they were found, at half of the image's resolution;
            ``NOBODY`` beside the body.
    """

    points: Array
    segments: NDArray[np.int64]
    labels: Image

    @property
    def pixels(self) -> Array:
        """(N, 2) where the points are."""
        return self.points[:, :2]

    @property
    def normals(self) -> Array:
        """(N, 2) unit vectors away from their segments, in the image."""
        return self.points[:, 2:4]

    @property
    def covered(self) -> Array | None:
        """(2, 2) least and greatest pixel that shows the body; None where none does."""
        rows, columns = np.nonzero(self.labels != NOBODY)
        if not len(rows):
            return None
        least, greatest = [columns.min(), rows.min()], [columns.max() + 1, rows.max() + 1]
        return SHRINK * np.array([least, greatest], np.float64)


@dataclass(frozen=True, eq=False)
class RegionEvidence:
    """Normal equations of an image for a change of world_T_segment, in the segments' axes, rotation first.

    Attributes:
        information: (S, 6, 6), every line by itself.
        vector: (S, 6).
        lines: (S,) lines that measure something.
        shifts, variances: (N,) how far outward of each contour point its line has the contour [px], and [px^2]; NaN of
            lines that measure nothing.
        asked: (S,) lines across the visible contour.
    """

    information: Array
    vector: Array
    lines: NDArray[np.int64]
    shifts: Array
    variances: Array
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
    """

    def __init__(self, station: StaticCamera, surface: BodySurface, jointed: Mask) -> None:
        self.station = station
        self._surface = surface
        self._jointed = jointed
        self._camera_T_world = inverse(station.world_T_camera)
        self._lens = station.camera.parameters
        self._colours = np.zeros((3, surface.segment_count, COLOURS), np.float32)
        self._inside, self._outside, self._areas = self._colours
        self._compare_colours()

    @property
    def has_colours(self) -> Mask:
        """(S,) segments with known colours on both sides of the contour."""
        known: Mask = np.logical_and(self._inside.any(axis=1), self._outside.any(axis=1))
        return known

    def find_contour(self, world_T_segment: Array) -> Contour:
        """The visible contours of a body at poses (S, 4, 4)."""
        surface, camera = self._surface, self.station.camera
        return Contour(
            *find_contour(
                self._lens,
                as_rows(self._camera_T_world @ world_T_segment),
                surface.vertices,
                surface.segment_of_vertex,
                surface.faces,
                surface.face_normals,
                surface.face_offsets,
                surface.segment_of_face,
                surface.edges,
                surface.edge_faces,
                self._stands_out,
                camera.width,
                camera.height,
                SHRINK,
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
        measured = measure_lines(
            image, labels, SHRINK, points, segments, self._stands_out, self._log_odds, stride, LEAST_SIGMA_PX * stride
        )
        return RegionEvidence(*measured, np.bincount(segments, minlength=self._surface.segment_count))

    def explain_pixels(self, image: Image, contour: Contour) -> tuple[Array, Array]:
        """Pixels (S,) of segments that have their colours, less those with the colours beside them (B eq. 8), and all.

        Both at the resolution of the labels.
        """
        areas = self._count_areas(image, contour)
        explained: Array = (areas * self._gains).sum(axis=1, dtype=np.float64)
        return explained, areas.sum(axis=1, dtype=np.float64)

    def explain_by(self, image: Image, contour: Contour, rows: NDArray[np.int64]) -> tuple[Array, Array]:
        """The same by the colours that the segments ``rows`` (S,) have inward of their contours."""
        areas = self._count_areas(image, contour)
        gains = np.tanh(0.5 * np.log((self._inside[rows] + _UNSEEN) / (self._outside + _UNSEEN)))
        explained: Array = (areas * gains).sum(axis=1, dtype=np.float64)
        return explained, areas.sum(axis=1, dtype=np.float64)

    def copy_unknown_colours(self, others: Iterable["RegionModel"]) -> None:
        """Take unknown colours from other cameras: clothes look alike from all sides."""
        unknown = ~self._areas.any(axis=1)
        if not unknown.any():
            return
        shared = sum((other._areas for other in others), np.zeros_like(self._areas))
        rows = unknown & shared.any(axis=1)
        self._areas[rows] = self._inside[rows] = shared[rows] / shared[rows].sum(axis=1, keepdims=True)
        self._compare_colours()

    @property
    def colours(self) -> NDArray[np.float32]:
        """(3, S, COLOURS) shares of each colour inward of the contours, outward, and where segments are in front."""
        return self._colours.copy()

    def replace_colours(self, colours: NDArray[np.float32] | float) -> None:
        """Take other ``colours``; 0 for none."""
        self._colours[:] = colours
        self._compare_colours()

    def copy_colours(self, source: Mapping[int, int]) -> None:
        """Copy the colours of segments: row -> row that has them."""
        self._colours[:, [*source]] = self._colours[:, [*source.values()]]
        self._compare_colours()

    def update_colours(self, image: Image, contour: Contour, rate: float, which: Mask) -> None:
        """Update the colours of some segments (S,) along their contours; unknown ones are taken at once."""
        inside, outside = count_colours(
            image, contour.labels, SHRINK, contour.points, contour.segments, self._stands_out, _INWARD_PX, _OUTWARD_PX
        )
        areas = self._count_areas(image, contour)
        # No line is inside a segment that is in front of others with its colours.
        inside = np.where(inside.sum(axis=1, keepdims=True) > _LEAST_PIXELS, inside, areas)
        counts = np.stack([inside, outside, areas])
        totals = counts.sum(axis=2, keepdims=True)
        rates = np.where(self._colours.any(axis=2, keepdims=True), rate, 1.0) * (totals > _LEAST_PIXELS)
        rates = (rates * which[:, None]).astype(np.float32)
        self._colours += rates * (counts / np.maximum(totals, 1.0) - self._colours)
        self._compare_colours()

    def _count_areas(self, image: Image, contour: Contour) -> NDArray[np.float32]:
        """(S, COLOURS) how often each colour is where a segment is in front, at the resolution of the labels."""
        shown = contour.labels != NOBODY
        colours = image[SHRINK // 2 :: SHRINK, SHRINK // 2 :: SHRINK][shown].astype(np.int64) * BINS // 256
        rows = contour.labels[shown].astype(np.int64) * COLOURS + colours @ [BINS * BINS, BINS, 1]
        counts = np.bincount(rows, minlength=self._areas.size)
        return counts.reshape(self._areas.shape).astype(np.float32)

    def _compare_colours(self) -> None:
        """Compare colours inside with those outside, and of each segment with the others'.

        A border between two segments counts where their colours differ, and no joint connects them.
        """
        self._log_odds = np.log((self._inside + _UNSEEN) / (self._outside + _UNSEEN))
        self._gains = np.tanh(0.5 * self._log_odds)
        roots, known = np.sqrt(self._areas), self._areas.any(axis=1)
        differs = (roots @ roots.T < _ALIKE) & np.outer(known, known)
        self._stands_out = np.ascontiguousarray(differs & ~self._jointed, np.uint8)
