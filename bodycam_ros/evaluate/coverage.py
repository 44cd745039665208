"""Coverage of a place by a map: in which directions a body camera registers from where a person stands.

A landmark counts as visible by the criteria of registration: large enough in the image, and seen from about the
direction of a photograph. Occlusion is not known.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from bodycam_ros.camera import camera_from_info
from bodycam_ros.geometry import Array, rotation_to_z
from bodycam_ros.progress import Progress
from bodycam_ros.registration.matching import MAX_VIEW_ANGLE_DEG, MIN_VISIBLE_SCALE_PX
from bodycam_ros.registration.reference_map import ReferenceMap

COVERAGE_FILE = "coverage.png"
"""In a map folder, the picture of ``draw_coverage``."""

_WIDTH = 640
_HEIGHT = 480
_VIEW_RAD = np.radians(150.0)
_FOCAL = _WIDTH / _VIEW_RAD
_K = (_FOCAL, 0.0, (_WIDTH - 1) / 2, 0.0, _FOCAL, (_HEIGHT - 1) / 2, 0.0, 0.0, 1.0)
BODY_CAMERA = camera_from_info("body", _WIDTH, _HEIGHT, "equidistant", [0.0] * 4, _K)
"""A typical one: 640x480, 150 degrees across."""

_ENOUGH = 500  # landmarks in view: with that many 98 % of the images register, with 160 to 480 two in three
_SPACING_M = 1.0  # between places on the floor; a person walks this far from where photographs were taken
_HEIGHTS_M = (0.5, 1.5)  # of the lowest body cameras, such as on shins, and the highest
_STEP_DEG = 15.0  # between directions
_MAX_ELEVATION_DEG = 60.0  # up and down, to which body cameras point most of the time
_MAX_PLACES = 80  # on the floor; of more, every n-th
_MAX_COUNTED = 700  # landmarks around a place; of more, every n-th counts for n

_MISSING = 0.5  # share of the places that must see enough in a direction
_MAX_LINES = 4
_MIN_GAP = 0.01  # of all directions


@dataclass(frozen=True, eq=False)
class Coverage:
    """Landmarks in view of a body camera from P places in E x A directions.

    Attributes:
        places_world: (P, 3) in the map's unit.
        elevations_deg: (E,) of the optical axis, ascending.
        azimuths_deg: (A,) of the optical axis, counter-clockwise from the map's x axis, all around.
        visible: (P, E, A) landmarks in view.
    """

    places_world: Array
    elevations_deg: Array
    azimuths_deg: Array
    visible: NDArray[np.int64]

    @cached_property
    def share_by_direction(self) -> Array:
        """(E, A) of the places, from which a camera registers in that direction."""
        return np.asarray((self.visible >= _ENOUGH).mean(axis=0), np.float64)

    @cached_property
    def weights(self) -> Array:
        """(E, A) solid angle of each direction; the sum is 1."""
        cosines = np.repeat(np.cos(np.radians(self.elevations_deg))[:, None], len(self.azimuths_deg), axis=1)
        return np.asarray(cosines / cosines.sum(), np.float64)

    @property
    def share(self) -> float:
        """Share of all directions at all places, in which a camera registers."""
        return float(np.sum(self.weights * self.share_by_direction))


def upright_map(reference_map: ReferenceMap) -> ReferenceMap:
    """The map itself if its z is up; else its landmarks and photographs, turned until photographs are upright."""
    if reference_map.gravity_aligned:
        return reference_map
    up = -reference_map.world_T_camera[:, :3, 1].mean(axis=0)
    R = rotation_to_z(up / max(float(np.linalg.norm(up)), 1e-9))
    poses = reference_map.world_T_camera.copy()
    poses[:, :3] = R @ poses[:, :3]
    return replace(
        reference_map,
        points_world=reference_map.points_world @ R.T,
        world_T_camera=poses,
        descriptor_view=(reference_map.descriptor_view @ R.T).astype(np.float32),
    )


def measure_coverage(reference_map: ReferenceMap, progress: Progress) -> Coverage:
    """Count the landmarks in view from places in a map whose z is up (``upright_map``), in all directions."""
    places = _places(reference_map)
    elevations = np.arange(-_MAX_ELEVATION_DEG, _MAX_ELEVATION_DEG + 1e-6, _STEP_DEG)
    azimuths = np.linspace(-180.0, 180.0, round(360.0 / _STEP_DEG), endpoint=False)
    forward = _directions_world(*np.meshgrid(elevations, azimuths, indexing="ij"))
    right = np.cross(forward, [0.0, 0.0, 1.0])
    right /= np.linalg.norm(right, axis=-1, keepdims=True)
    world_R_camera = np.stack([right, np.cross(forward, right), forward], axis=-1)
    visible = np.zeros((len(places), *forward.shape[:2]), np.int64)
    with progress.step("checking the coverage", len(places)) as advance:
        for row, place in enumerate(places):
            visible[row] = _count_visible(reference_map, place, world_R_camera)
            advance()
    return Coverage(places, elevations, azimuths, visible)


def _directions_world(elevations_deg: Array, azimuths_deg: Array) -> Array:
    """(..., 3) unit vectors in the map's axes."""
    elevation, azimuth = np.radians(elevations_deg), np.radians(azimuths_deg)
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation)], axis=-1)


def _places(reference_map: ReferenceMap) -> Array:
    """(P, 3) where a person would stand: around the photographs, at the height of a body's cameras.

    Without metres or a vertical they are those of the photographs.
    """
    centres = reference_map.world_T_camera[:, :3, 3]
    if not (reference_map.metric and reference_map.gravity_aligned):
        return np.asarray(centres[:: -(-len(centres) // _MAX_PLACES)])
    beside = np.stack(np.meshgrid([-1.0, 0.0, 1.0], [-1.0, 0.0, 1.0]), axis=-1).reshape(-1, 2)
    cells = np.round(centres[:, None, :2] / _SPACING_M) + beside
    floor = _SPACING_M * np.unique(cells.reshape(-1, 2), axis=0)
    floor = floor[:: -(-len(floor) // _MAX_PLACES)]
    return np.concatenate([np.column_stack([floor, np.full(len(floor), height)]) for height in _HEIGHTS_M])


def _count_visible(reference_map: ReferenceMap, place_world: Array, world_R_camera: Array) -> NDArray[np.int64]:
    """(E, A) landmarks that can be matched from a place (3,), in the images of cameras (E, A, 3, 3)."""
    offsets = reference_map.points_world - place_world
    distances = np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)
    large = reference_map.landmark_sizes * BODY_CAMERA.fx > MIN_VISIBLE_SCALE_PX * distances
    landmark = reference_map.descriptor_landmark
    cosines = -np.einsum("ij,ij->i", reference_map.descriptor_view, offsets[landmark]) / distances[landmark]
    alike = np.zeros(len(offsets), bool)
    alike[landmark[cosines > np.cos(np.radians(MAX_VIEW_ANGLE_DEG))]] = True
    offsets = offsets[large & alike]
    every = max(1, -(-len(offsets) // _MAX_COUNTED))
    points = np.einsum("eaij,vi->eavj", world_R_camera, offsets[::every])
    pixels, valid = BODY_CAMERA.project(points.reshape(-1, 3))
    shown = (valid & BODY_CAMERA.in_image(pixels)).reshape(points.shape[:3])
    return np.asarray(every * shown.sum(axis=2), np.int64)


@dataclass(frozen=True, eq=False)
class Gap:
    """Connected directions in which most places have too few landmarks.

    Attributes:
        cells: (E, A) which directions.
        azimuth_deg, elevation_deg: of their middle.
        all_around: whether it has no azimuth of its own.
        elevations_deg: lowest and highest.
        share: of the places, which have enough landmarks in these directions.
        size: solid angle of the missing directions, as a share of all.
    """

    cells: NDArray[np.bool_]
    azimuth_deg: float
    elevation_deg: float
    all_around: bool
    elevations_deg: tuple[float, float]
    share: float
    size: float

    @property
    def line(self) -> str:
        """What should be photographed, too."""
        low, high = self.elevations_deg
        what = "this wall"
        where = f"towards azimuth {self.azimuth_deg:.0f} deg from the map's x axis, counter-clockwise"
        if self.all_around:
            what, where = "the ceiling" if low > 0.0 else "the floor" if high < 0.0 else "more", "all around"
        return (
            f"photograph {what} too: {where}, elevation {low:.0f} to {high:.0f} deg; a camera registers there from "
            f"{100 * self.share:.0f} % of the places"
        )


def find_gaps(coverage: Coverage) -> list[Gap]:
    """Directions that are missing, the largest gap first."""
    labels, count = label(coverage.share_by_direction < _MISSING)
    # The last column is beside the first.
    for left, right in zip(labels[:, 0], labels[:, -1], strict=True):
        if left and right and left != right:
            labels[labels == right] = left
    gaps = [_gap(coverage, labels == each) for each in range(1, count + 1) if (labels == each).any()]
    return sorted((gap for gap in gaps if gap.size >= _MIN_GAP), key=lambda gap: -gap.size)


def _gap(coverage: Coverage, cells: NDArray[np.bool_]) -> Gap:
    rows, columns = np.nonzero(cells)
    elevations, share = coverage.elevations_deg[rows], coverage.share_by_direction[cells]
    weights = coverage.weights[cells] * (1.0 - share)
    x, y, _ = weights @ _directions_world(elevations, coverage.azimuths_deg[columns])
    elevation = float(np.average(elevations, weights=weights))
    at_middle = cells[int(np.argmin(np.abs(coverage.elevations_deg - elevation)))]
    return Gap(
        cells=cells,
        azimuth_deg=float(np.degrees(np.arctan2(y, x))),
        elevation_deg=elevation,
        all_around=bool((at_middle if at_middle.any() else cells.any(axis=0)).all()),
        elevations_deg=(float(elevations.min()), float(elevations.max())),
        share=float(share.mean()),
        size=float(coverage.weights[cells].sum()),
    )


def coverage_lines(coverage: Coverage) -> list[str]:
    """Sentences on what the map covers, and what should be photographed too."""
    return [
        f"coverage: a body camera would register in {100 * coverage.share:.0f} % of all directions from "
        f"{len(coverage.places_world)} places where a person would be ({_ENOUGH} landmarks in view are enough)",
        *[gap.line for gap in find_gaps(coverage)[:_MAX_LINES]],
    ]


def with_coverage(reference_map: ReferenceMap, coverage: Coverage) -> ReferenceMap:
    """The same map with the coverage in its summary, as plain values."""
    gaps = [
        dict(azimuth_deg=round(gap.azimuth_deg), elevation_deg=round(gap.elevation_deg), share=round(gap.share, 2))
        for gap in find_gaps(coverage)
    ]
    document = dict(
        share=round(coverage.share, 3), places=len(coverage.places_world), enough_landmarks=_ENOUGH, gaps=gaps
    )
    return replace(reference_map, summary={**reference_map.summary, "coverage": document})
