"""The scale of a map from a distance measured between two body cameras on the same segment.

It is measured with a tape, between the middles of the lenses: two cameras at the waist are some 0.3 m apart, which a
tape measures to 3 mm. The scatter of their distance in the map gives its uncertainty, and shows whether both are on one
segment at all.
"""

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import MapError
from bodycam_ros.mapping.structure import Structure

MAX_APART_S = 0.02
"""Between two frames that count as simultaneous."""

_TAPE_SIGMA_M = 0.003
_MAX_SCATTER = 0.1  # of the distance in the map, relative; more between cameras on different segments
_MIN_COUNT = 4  # of frame pairs that a scatter takes
_TO_SIGMA = 1.4826  # of a normal distribution over its median absolute deviation
_MAX_SIGMAS_APART = 4.0  # between two distances that agree


@dataclass(frozen=True)
class KnownDistance:
    """A measured distance [m] between the lenses of two body cameras."""

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
class KnownScale:
    """Metres per unit of a structure, and its relative sigma; ``summary`` describes each distance in plain values."""

    scale: float
    sigma: float
    summary: Sequence[dict[str, Any]] = ()


def measure_scale(
    structure: Structure, seconds_of_name: Mapping[str, float], distances: Sequence[KnownDistance]
) -> KnownScale:
    """Scale a structure by known distances between body cameras.

    Args:
        structure: of frames of body cameras.
        seconds_of_name: file name -> stamp [s].
        distances: one or more.

    Raises:
        MapError: too few frames show a distance, or it changes, or two of them contradict each other.
    """
    scales, sigmas, summary = [], [], []
    for known in distances:
        lengths = _lengths(structure, seconds_of_name, known)
        between = f"known distance between {known.first} and {known.second}"
        if len(lengths) < _MIN_COUNT:
            raise MapError(
                f"{between}: both have frames in the map at {len(lengths)} times, {_MIN_COUNT} are needed; choose two "
                "cameras that see the room well, on one segment"
            )
        length = float(np.median(lengths))
        scatter = _TO_SIGMA * float(np.median(np.abs(lengths - length))) / length
        if scatter > _MAX_SCATTER:
            raise MapError(
                f"{between}: changes by {100 * scatter:.0f} % during the recording, at most {100 * _MAX_SCATTER:g} % "
                "is expected; are both on the same segment?"
            )
        scales.append(known.metres / length)
        sigmas.append(float(np.hypot(scatter / np.sqrt(len(lengths)), _TAPE_SIGMA_M / known.metres)))
        summary.append(asdict(known) | {"pairs": len(lengths), "relative_scatter": round(scatter, 5)})
    weights, logs = np.array(sigmas) ** -2.0, np.log(scales)
    mean = float(weights @ logs / weights.sum())
    if np.max(np.abs(logs - mean) * np.sqrt(weights)) > _MAX_SIGMAS_APART:
        each = "; ".join(
            f"{known.first} to {known.second}: 1 to {scale:.4g} +- {100 * sigma:.1f} %"
            for known, scale, sigma in zip(distances, scales, sigmas, strict=True)
        )
        raise MapError(f"the known distances contradict each other. Scale by each: {each}. Measure them again")
    return KnownScale(float(np.exp(mean)), float(weights.sum() ** -0.5), summary)


def _lengths(structure: Structure, seconds_of_name: Mapping[str, float], known: KnownDistance) -> NDArray[np.float64]:
    """Distances (N,) of the two cameras in the structure, at the times of which it has both."""
    cameras = np.array([structure.cameras[row].name for row in structure.camera_of_view])
    first, second = (np.flatnonzero(cameras == camera) for camera in (known.first, known.second))
    seconds = np.array([seconds_of_name[name] for name in structure.names])
    apart_s = np.abs(seconds[first, None] - seconds[second])
    pairs = np.nonzero(apart_s <= np.minimum(MAX_APART_S, apart_s.min(axis=1, initial=np.inf, keepdims=True)))
    centres = structure.world_T_camera[:, :3, 3]
    return np.asarray(np.linalg.norm(centres[first[pairs[0]]] - centres[second[pairs[1]]], axis=1), np.float64)
