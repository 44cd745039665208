"""The scale of a map from a distance that its maker has measured: between two worn cameras on the same segment.

With a tape, between the middles of the lenses, once the cameras are strapped on: two at the waist are some 0.3 m apart,
which a tape tells to 3 mm. How the map's own length scatters from instant to instant says how well it is known there,
and whether the two are rigidly apart at all.
"""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.structure import Structure
from bodycam_ros.mapping.worn_keyframes import Moment
from bodycam_ros.settings import setting

_LOG = logging.getLogger(__name__)

_FEWEST = 4  # instants of which a scatter can be told
_TO_SIGMA = 1.4826  # of a normal distribution over its median absolute deviation
_CONTRADICTION = 4.0  # sigmas between two distances


@dataclass(frozen=True)
class KnownDistanceSettings:
    """How well distances are measured, and when they are refused."""

    tape: float = setting(
        0.003, unit="m", limits=(0.0, 0.1), reason="sigma of a distance between two lenses that is measured by a tape"
    )
    max_apart: float = setting(
        0.02, unit="s", limits=(0.0, 0.2), reason="between two keyframes that are taken to be of the same instant"
    )
    max_scatter: float = setting(
        0.1,
        limits=(0.001, 1.0),
        reason="of the distance in the map over itself; cameras on different segments scatter by more",
    )


@dataclass(frozen=True)
class KnownDistance:
    """A measured distance [m] between the lenses of two worn cameras."""

    first: str
    second: str
    metres: float

    def __post_init__(self) -> None:
        if self.first == self.second or not 0.01 <= self.metres <= 10.0:
            raise MapError(
                f"known distance between {self.first} and {self.second}: {self.metres:g} m; expected two different "
                "cameras on one segment, and the distance between their lenses in metres, from 0.01 to 10"
            )


@dataclass(frozen=True)
class DistanceView:
    """What the map makes of a known distance.

    Attributes:
        known: the distance.
        instants: how many pairs of keyframes show it.
        scatter: of its length in the map from instant to instant, over itself.
        scale: metres per unit of the structure.
        sigma: of the scale, over itself.
    """

    known: KnownDistance
    instants: int
    scatter: float
    scale: float
    sigma: float


@dataclass(frozen=True)
class KnownScale:
    """What known distances say of a structure: metres per unit, the sigma of that over itself, and each of them."""

    scale: float
    sigma: float
    distances: tuple[DistanceView, ...]

    def as_mapping(self) -> dict[str, Any]:
        """Plain values, for people; the lengths in the map before it was scaled are left out."""
        return {
            "relative_sigma": round(self.sigma, 5),
            "distances": [
                asdict(view.known) | {"instants": view.instants, "relative_scatter": round(view.scatter, 5)}
                for view in self.distances
            ],
        }


def measure_scale(
    structure: Structure,
    moments: Mapping[str, Moment],
    distances: Sequence[KnownDistance],
    settings: KnownDistanceSettings,
) -> KnownScale:
    """Scale a structure by known distances between worn cameras.

    Raises:
        MapError: too few instants show a distance, or it changes, or two of them contradict each other.
    """
    views = tuple(_viewed(structure, moments, known, settings) for known in distances)
    weights = np.array([view.sigma**-2.0 for view in views])
    logs = np.log([view.scale for view in views])
    mean = float(weights @ logs / weights.sum())
    sigmas = np.abs(logs - mean) * np.sqrt(weights)
    if sigmas.max() > _CONTRADICTION:
        said = "; ".join(
            f"{v.known.first} to {v.known.second}: 1 to {v.scale:.4g} +- {100 * v.sigma:.1f} %" for v in views
        )
        raise MapError(f"the known distances contradict each other. Scale by each: {said}. Measure them again")
    return KnownScale(float(np.exp(mean)), float(weights.sum() ** -0.5), views)


def _viewed(
    structure: Structure, moments: Mapping[str, Moment], known: KnownDistance, settings: KnownDistanceSettings
) -> DistanceView:
    lengths = _lengths(structure, moments, known, settings.max_apart)
    between = f"known distance between {known.first} and {known.second}"
    if len(lengths) < _FEWEST:
        raise MapError(
            f"{between}: {len(lengths)} instants have a keyframe of both in the map, {_FEWEST} are needed; choose two "
            "cameras that see the room well, on one segment"
        )
    length = float(np.median(lengths))
    scatter = _TO_SIGMA * float(np.median(np.abs(lengths - length))) / length
    if scatter > settings.max_scatter:
        raise MapError(
            f"{between}: changes by {100 * scatter:.0f} % from instant to instant, at most "
            f"{100 * settings.max_scatter:g} % is expected (known_distance.max_scatter); are both on the same segment?"
        )
    sigma = float(np.hypot(scatter / np.sqrt(len(lengths)), settings.tape / known.metres))
    return DistanceView(known, len(lengths), scatter, known.metres / length, sigma)


def _lengths(
    structure: Structure, moments: Mapping[str, Moment], known: KnownDistance, max_apart_s: float
) -> NDArray[np.float64]:
    """Distances (N,) of the two cameras in the structure, at the instants of which it has both."""
    centres = structure.world_T_camera[:, :3, 3]
    rows = {
        camera: [row for row, name in enumerate(structure.names) if moments[name].camera == camera]
        for camera in (known.first, known.second)
    }
    times = {camera: np.array([moments[structure.names[row]].seconds for row in rows[camera]]) for camera in rows}
    lengths = []
    for row, seconds in zip(rows[known.first], times[known.first].tolist(), strict=True):
        apart = np.abs(times[known.second] - seconds)
        if len(apart) and apart.min() <= max_apart_s:
            lengths.append(float(np.linalg.norm(centres[row] - centres[rows[known.second][int(apart.argmin())]])))
    return np.array(lengths)
