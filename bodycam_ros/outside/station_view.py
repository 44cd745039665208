"""What one station's images say of the segments of a body, by the colours on both sides of their contours (B 2.4)."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.geometry import Array, inverse
from bodycam_ros.kernels.kernel import as_rows
from bodycam_ros.outside.body_surface import BodySurface
from bodycam_ros.outside.contour_kernels import find_contour
from bodycam_ros.outside.region_kernels import COLOURS, ask_lines, count_areas, count_colours, line_shifts, weigh_areas
from bodycam_ros.outside.region_settings import RegionSettings
from bodycam_ros.outside.seen_contour import SeenContour
from bodycam_ros.outside.station import Station

_SHRINK = 2  # pixels of the image that are one of the picture of who is in front
_MOST_POINTS = 6000
_UNSEEN = 1e-4  # likelihood of a colour that was never seen: noise, and what stands before the background for a moment
_ALIKE = 0.5  # Bhattacharyya coefficient from which on the colours of two segments are one
_LEAST_PIXELS = 30.0  # that make a statistic

Image = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class SegmentRegions:
    """What an image says of every segment: of a change of world_T_segment, in the segments' axes, rotation first.

    Attributes:
        information: (S, 6, 6), every line by itself.
        vector: (S, 6).
        lines: (S,) lines that know something.
        asked: (S,) lines across the visible contour.
    """

    information: Array
    vector: Array
    lines: NDArray[np.int64]
    asked: NDArray[np.int64]

    @property
    def confidence(self) -> Array:
        """(S,) share of the lines that know something; 0 where there are none."""
        share: Array = self.lines / np.maximum(self.asked, 1)
        return share


class StationView:
    """Knows the colours of segments, and of what is beside them, as one station sees them.

    Args:
        station: where it stands, and its lens.
        surface: of the body.
        settings: lines and colours.
        jointed: (S, S) which segments a joint ties to each other.
    """

    def __init__(
        self, station: Station, surface: BodySurface, settings: RegionSettings, jointed: NDArray[np.bool_]
    ) -> None:
        self.station = station
        self._surface, self._settings = surface, settings
        self._jointed = jointed
        self._stands_out = np.zeros(jointed.shape, np.uint8)
        self._camera_T_world = inverse(station.world_T_camera)
        self._lens = station.camera.parameters
        self._inside = np.zeros((surface.segment_count, COLOURS))
        self._outside = np.zeros((surface.segment_count, COLOURS))
        self._areas = np.zeros((surface.segment_count, COLOURS))
        self._log_odds = np.zeros((surface.segment_count, COLOURS), np.float32)

    @property
    def knows(self) -> NDArray[np.bool_]:
        """(S,) of which segments it knows colours on both sides of the contour."""
        known: NDArray[np.bool_] = np.logical_and(self._inside.any(axis=1), self._outside.any(axis=1))
        return known

    def look(self, image: Image, world_T_segment: Array, stride: int) -> SegmentRegions:
        """Ask the lines across the contours of a body at poses (S, 4, 4), ``stride`` pixels a sample."""
        points, segments, labels = self._contour(world_T_segment)
        least_px = self._settings.least_sigma * stride
        said = ask_lines(image, labels, _SHRINK, points, segments, self._stands_out, self._log_odds, stride, least_px)
        return SegmentRegions(*said, np.bincount(segments, minlength=self._surface.segment_count))

    def energy(self, image: Image, world_T_segment: Array) -> float:
        """How much better a body at poses (S, 4, 4) explains an image than no body does (B eq. 8)."""
        _, _, labels = self._contour(world_T_segment)
        return weigh_areas(image, labels, _SHRINK, self._log_odds)

    def adopt(self, source: Mapping[int, int]) -> None:
        """Take the colours of one segment for those of another: row -> row that has them."""
        for row, alike in source.items():
            for known in (self._inside, self._outside, self._areas, self._log_odds):
                known[row] = known[alike]
        self._stands_out = self._differing()

    def learn(self, image: Image, world_T_segment: Array, rate: float, which: NDArray[np.bool_]) -> None:
        """Learn the colours of some segments (S,) at poses (S, 4, 4); of those never seen before, at once."""
        points, segments, labels = self._contour(world_T_segment)
        of = self._settings
        inside, outside = count_colours(
            image, labels, _SHRINK, points, segments, self._stands_out, of.inward, of.outward
        )
        areas = count_areas(image, labels, _SHRINK, len(which))
        # Of a segment that is in front of others alike, no line says what is inside.
        inside = np.where(inside.sum(axis=1, keepdims=True) > _LEAST_PIXELS, inside, areas)
        for known, counts in ((self._inside, inside), (self._outside, outside), (self._areas, areas)):
            self._blend(known, counts, rate, which)
        self._log_odds[:] = np.log((self._inside + _UNSEEN) / (self._outside + _UNSEEN))
        self._stands_out = self._differing()

    def contour(self, world_T_segment: Array) -> tuple[Array, NDArray[np.int64]]:
        """Pixels (N, 2) of the visible contours of a body at poses (S, 4, 4), and their segments (N,)."""
        points, segments, _ = self._contour(world_T_segment)
        return points[:, :2], segments

    def seen_contour(self, image: Image, world_T_segment: Array) -> SeenContour:
        """The visible contours of a body at poses (S, 4, 4), and where the colours that are known would have them."""
        points, segments, labels = self._contour(world_T_segment)
        shifts = line_shifts(image, labels, _SHRINK, points, segments, self._stands_out, self._log_odds, 1)
        return SeenContour(points[:, :2], points[:, 2:4], segments, shifts, labels, _SHRINK)

    @staticmethod
    def _blend(known: Array, counts: Array, rate: float, which: NDArray[np.bool_]) -> None:
        """Let what is known (S, COLOURS) of some segments follow what is counted; what is new is taken as it is."""
        enough = which & (counts.sum(axis=1) > _LEAST_PIXELS)
        share = counts[enough] / counts[enough].sum(axis=1, keepdims=True)
        fresh = known[enough].sum(axis=1, keepdims=True) == 0.0
        known[enough] += np.where(fresh, 1.0, rate) * (share - known[enough])

    def _differing(self) -> NDArray[np.uint8]:
        """(S, S) which segments have other colours than each other; those that a joint ties have no border."""
        roots = np.sqrt(self._areas)
        known = self._areas.sum(axis=1) > 0.0
        differs = (roots @ roots.T < _ALIKE) & np.outer(known, known)
        return np.ascontiguousarray(differs & ~self._jointed, np.uint8)

    def _contour(self, world_T_segment: Array) -> tuple[Array, NDArray[np.int64], Image]:
        of, camera = self._surface, self.station.camera
        return find_contour(
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
            self._settings.line_spacing,
            _MOST_POINTS,
        )
