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
from bodycam_ros.inertial.map_alignment import RegisteredPoses

_MAX_APART_NS = 20_000_000  # between two images that count as simultaneous
_TAPE_SIGMA_M = 0.003
_MAX_SCATTER = 0.1  # of the distance in the map, relative; more between cameras on different segments
_MIN_COUNT = 4  # of image pairs that a scatter takes
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
    """Metres per unit of a map, and its relative sigma; ``summary`` describes each distance in plain values."""

    scale: float
    sigma: float
    summary: Sequence[dict[str, Any]] = ()


def measure_scale(poses: Mapping[str, RegisteredPoses], distances: Sequence[KnownDistance]) -> KnownScale:
    """Scale a map by known distances between body cameras.

    Args:
        poses: camera -> its images that are registered in the map.
        distances: one or more.

    Raises:
        MapError: too few images show a distance, or it changes, or two of them contradict each other.
    """
    scales, sigmas, summary = [], [], []
    for known in distances:
        lengths = _lengths(poses[known.first], poses[known.second])
        between = f"known distance between {known.first} and {known.second}"
        if len(lengths) < _MIN_COUNT:
            raise MapError(
                f"{between}: both are registered in the map at {len(lengths)} times, {_MIN_COUNT} are needed; choose "
                "two cameras that see the room well, on one segment"
            )
        length = float(np.median(lengths))
        scatter = _TO_SIGMA * float(np.median(np.abs(lengths - length))) / length
        if scatter > _MAX_SCATTER:
            raise MapError(
                f"{between}: changes by {100 * scatter:.0f} % during the recording, at most {100 * _MAX_SCATTER:g} % "
                "is expected; check that both are on the same segment"
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


def _lengths(first: RegisteredPoses, second: RegisteredPoses) -> NDArray[np.float64]:
    """Distances (N,) of two cameras at the times at which images of both are registered."""
    if not len(first[0]) or not len(second[0]):
        return np.zeros(0)
    apart_ns = np.abs(first[0][:, None] - second[0])
    nearest = apart_ns.argmin(axis=1)
    lengths = np.linalg.norm(first[1][:, :3, 3] - second[1][nearest, :3, 3], axis=1)
    return np.asarray(lengths[apart_ns.min(axis=1) <= _MAX_APART_NS], np.float64)
