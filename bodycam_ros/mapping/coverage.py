"""How well a map covers a place: where a person would stand, would a worn camera find itself, wherever it looks?

A landmark counts as seen by the criteria that registration matches by: large enough in the image, and looked at from
about where a photograph looked at it. What stands in between is not known.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.camera import camera_from_info
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.registration.matching import MatchingSettings
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.settings import setting

Array = NDArray[np.float64]

COVERAGE_FILE = "coverage.png"
"""In a map folder, what ``coverage_picture`` draws."""

_WIDTH, _HEIGHT, _VIEW_RAD = 640, 480, np.radians(150.0)
_FOCAL = _WIDTH / _VIEW_RAD
_K = (_FOCAL, 0.0, (_WIDTH - 1) / 2, 0.0, _FOCAL, (_HEIGHT - 1) / 2, 0.0, 0.0, 1.0)
WORN_CAMERA = camera_from_info("worn", _WIDTH, _HEIGHT, "equidistant", [0.0] * 4, _K)
"""What people strap on: 640x480, 150 degrees across."""

_MOST_PLACES = 80  # on the floor; a large place is looked at in wider steps
_MOST_COUNTED = 2000  # landmarks around a place; of more, every n-th counts for n


@dataclass(frozen=True)
class CoverageSettings:
    """How a map is checked when it is made."""

    enough: int = setting(
        500,
        unit="landmarks",
        limits=(12, 100_000),
        reason="that a worn camera should see: with that many or more predicted, 98 % of the images of two recordings "
        "were registered in halves of a map, with 160 to 480 two in three",
    )
    spacing: float = setting(
        1.0, unit="m", limits=(0.1, 20.0), reason="between the places on the floor that are looked at"
    )
    reach: float = setting(
        1.0, unit="m", limits=(0.1, 50.0), reason="a person walks this far from where photographs were taken"
    )
    low: float = setting(0.5, unit="m", limits=(0.0, 3.0), reason="height of the lowest cameras, such as on shins")
    high: float = setting(1.5, unit="m", limits=(0.0, 3.0), reason="height of the highest, such as on the head")
    step_deg: float = setting(15.0, unit="deg", limits=(5.0, 45.0), reason="between the directions that are looked in")
    elevation: float = setting(
        60.0, unit="deg", limits=(0.0, 80.0), reason="up and down to which worn cameras look most of the time"
    )


@dataclass(frozen=True, eq=False)
class Coverage:
    """What a worn camera would see of the map from P places in E x A directions.

    Attributes:
        places_world: (P, 3) in the map's unit.
        elevations_deg: (E,) of the optical axis, ascending.
        azimuths_deg: (A,) of the optical axis, counter-clockwise from the x axis of ``level_R_world``, all around.
        seen: (P, E, A) landmarks in sight.
        enough: landmarks from which on a camera registers.
        level_R_world: (3, 3) whose z is up: the map's own axes if these are upright, else up is where the photographs
            have it on average.
    """

    places_world: Array
    elevations_deg: Array
    azimuths_deg: Array
    seen: NDArray[np.int64]
    enough: int
    level_R_world: Array

    @cached_property
    def registers(self) -> NDArray[np.bool_]:
        """(P, E, A) whether a camera there finds itself."""
        return self.seen >= self.enough

    @cached_property
    def weights(self) -> Array:
        """(E, A) how much of the sphere each direction stands for; the sum is 1."""
        cosines = np.repeat(np.cos(np.radians(self.elevations_deg))[:, None], len(self.azimuths_deg), axis=1)
        return np.asarray(cosines / cosines.sum(), np.float64)

    @property
    def share(self) -> float:
        """Of all directions at all places, in which a camera finds itself."""
        return float(np.einsum("pea,ea->p", self.registers, self.weights).mean())

    @property
    def share_by_direction(self) -> Array:
        """(E, A) of the places."""
        return np.asarray(self.registers.mean(axis=0), np.float64)

    @property
    def share_by_place(self) -> Array:
        """(P,) of the directions."""
        return np.asarray(np.einsum("pea,ea->p", self.registers, self.weights), np.float64)


def measure_coverage(
    reference_map: ReferenceMap,
    settings: CoverageSettings,
    progress: Progress,
    matching: MatchingSettings | None = None,
) -> Coverage:
    """Look around in a map.

    Args:
        reference_map: the map.
        settings: where to, and how many landmarks are enough.
        progress: shows the step.
        matching: when a landmark can be matched.
    """
    matching = matching or MatchingSettings()
    level_R_world = _level(reference_map)
    places = _places(reference_map, settings)
    highest = settings.step_deg * np.floor(settings.elevation / settings.step_deg)
    elevations = np.arange(-highest, highest + 1e-6, settings.step_deg)
    azimuths = np.linspace(-180.0, 180.0, round(360.0 / settings.step_deg), endpoint=False)
    world_R_camera = level_R_world.T @ _looking(*np.meshgrid(elevations, azimuths, indexing="ij"))
    seen = np.zeros((len(places), *world_R_camera.shape[:2]), np.int64)
    with progress.step("checking the coverage", len(places)) as advance:
        for row, place in enumerate(places):
            seen[row] = _counts(_visible_from(reference_map, place, matching), world_R_camera)
            advance()
    return Coverage(places, elevations, azimuths, seen, settings.enough, level_R_world)


def directions_level(elevations_deg: Array, azimuths_deg: Array) -> Array:
    """(..., 3) unit vectors in axes whose z is up."""
    elevation, azimuth = np.radians(elevations_deg), np.radians(azimuths_deg)
    flat = np.cos(elevation)
    return np.stack([flat * np.cos(azimuth), flat * np.sin(azimuth), np.sin(elevation) + 0.0 * azimuth], axis=-1)


def _level(reference_map: ReferenceMap) -> Array:
    """Rotation of the map's axes to some whose z is up."""
    if reference_map.gravity_aligned:
        return np.eye(3)
    # People hold cameras upright on average.
    up = -reference_map.world_T_camera[:, :3, 1].mean(axis=0)
    if np.linalg.norm(up) < 0.1:
        return np.eye(3)
    up /= np.linalg.norm(up)
    x = np.eye(3)[0] - up[0] * up
    if np.linalg.norm(x) < 0.1:
        x = np.eye(3)[1] - up[1] * up
    x /= np.linalg.norm(x)
    return np.stack([x, np.cross(up, x), up])


def _places(reference_map: ReferenceMap, settings: CoverageSettings) -> Array:
    """(P, 3) where a person would stand: around the photographs, at the height of a body's cameras.

    Where nobody knows metres or what is up, the places of the photographs themselves must do.
    """
    centres = reference_map.world_T_camera[:, :3, 3]
    if not (reference_map.metric and reference_map.gravity_aligned):
        return np.asarray(centres[:: -(-len(centres) // _MOST_PLACES)])
    spacing = settings.spacing
    while True:
        first, last = (np.round(edge / spacing) for edge in (centres.min(axis=0), centres.max(axis=0)))
        reach = np.ceil(settings.reach / spacing)
        x, y = (spacing * np.arange(first[axis] - reach, last[axis] + reach + 1.0) for axis in (0, 1))
        floor = np.stack(np.meshgrid(x, y, indexing="ij"), axis=-1).reshape(-1, 2)
        distances = np.linalg.norm(floor[:, None] - centres[None, :, :2], axis=2).min(axis=1)
        # A spacing wider than the reach may miss a photograph that stands alone.
        floor = floor[distances <= max(settings.reach, np.sqrt(0.5) * spacing)]
        if len(floor) <= _MOST_PLACES:
            break
        spacing *= 1.25
    heights = np.unique([settings.low, settings.high])
    return np.concatenate([np.column_stack([floor, np.full(len(floor), height)]) for height in heights])


def _looking(elevations_deg: Array, azimuths_deg: Array) -> Array:
    """(..., 3, 3) level_R_camera of cameras that are held upright and look in directions."""
    forward = directions_level(elevations_deg, azimuths_deg)
    azimuth = np.radians(azimuths_deg)
    right = np.stack([np.sin(azimuth), -np.cos(azimuth), 0.0 * azimuth], axis=-1)
    return np.stack([right, np.cross(forward, right), forward], axis=-1)


def _visible_from(reference_map: ReferenceMap, place_world: Array, matching: MatchingSettings) -> Array:
    """(V, 3) from a place to the landmarks that could be matched there, whichever way a camera looks."""
    offsets = reference_map.points_world - place_world
    distances = np.maximum(np.linalg.norm(offsets, axis=1), 1e-9)
    large = reference_map.landmark_sizes * WORN_CAMERA.fx > matching.min_visible_scale_px * distances
    landmark = reference_map.descriptor_landmark
    cosines = -np.einsum("ij,ij->i", reference_map.descriptor_view, offsets[landmark]) / distances[landmark]
    from_there = cosines > np.cos(np.radians(matching.max_view_angle_deg))
    alike: NDArray[np.bool_] = np.zeros(len(offsets), bool)
    alike[landmark[from_there]] = True
    return np.asarray(offsets[large & alike])


def _counts(offsets_world: Array, world_R_camera: Array) -> NDArray[np.int64]:
    """How many of the points (V, 3) cameras (E, A, 3, 3) have in their images: (E, A)."""
    every = max(1, -(-len(offsets_world) // _MOST_COUNTED))
    if not len(offsets_world):
        return np.zeros(world_R_camera.shape[:2], np.int64)
    points = np.einsum("eaij,vi->eavj", world_R_camera, offsets_world[::every])
    pixels, valid = WORN_CAMERA.project(points.reshape(-1, 3))
    shown = (valid & WORN_CAMERA.in_image(pixels)).reshape(points.shape[:3])
    return np.asarray(every * shown.sum(axis=2), np.int64)
