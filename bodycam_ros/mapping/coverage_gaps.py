"""What is missing in a map: walls that were not photographed, places where nobody stood; and how to say it."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import label

from bodycam_ros.mapping.coverage import Coverage, directions_level
from bodycam_ros.registration.reference_map import ReferenceMap

_MISSING = 0.5
"""A direction is missing where fewer of the places than this see enough in it; a place likewise."""

_MOST_SAID = 4
_SMALLEST = 0.01  # of all directions; less is not worth a walk
_APART_M = 2.0  # between two places that are both named


@dataclass(frozen=True, eq=False)
class Gap:
    """Directions that hang together, in which most places see too little.

    Attributes:
        cells: (E, A) which directions.
        azimuth_deg, elevation_deg: of their middle.
        azimuths_deg: first and last at the height of the middle, counter-clockwise; -180 and 180 if all are missing.
        elevations_deg: lowest and highest.
        share: of the places, which see enough in these directions.
        seen: landmarks that a camera sees there, the median.
        size: share of all directions that are missing here.
        nearest: the photograph that looks nearest to the middle.
        nearest_deg: how far from it that one looks.
    """

    cells: NDArray[np.bool_]
    azimuth_deg: float
    elevation_deg: float
    azimuths_deg: tuple[float, float]
    elevations_deg: tuple[float, float]
    share: float
    seen: int
    size: float
    nearest: str
    nearest_deg: float

    @property
    def all_around(self) -> bool:
        """Whether it has no azimuth of its own."""
        return self.azimuths_deg == (-180.0, 180.0)


def find_gaps(coverage: Coverage, reference_map: ReferenceMap) -> list[Gap]:
    """Directions that are missing, the largest gap first."""
    missing = coverage.share_by_direction < _MISSING
    gaps = [_gap(coverage, reference_map, cells) for cells in _groups(missing)]
    return sorted((gap for gap in gaps if gap.size >= _SMALLEST), key=lambda gap: -gap.size)


def poor_places(coverage: Coverage) -> NDArray[np.float64]:
    """(N, 3) places from which a camera finds itself in few directions, in the map's frame, the worst first."""
    share = coverage.share_by_place
    poor = np.flatnonzero(share < _MISSING)
    return np.asarray(coverage.places_world[poor[np.argsort(share[poor], kind="stable")]])


def coverage_lines(coverage: Coverage, reference_map: ReferenceMap) -> list[str]:
    """Sentences about what the map covers, and what should be photographed too."""
    unit = " m" if reference_map.metric else ""
    lines = [
        f"coverage: a worn camera would find itself in {100 * coverage.share:.0f} % of all directions from "
        f"{len(coverage.places_world)} places where a person would be ({coverage.enough} landmarks in sight are enough)"
    ]
    gaps = find_gaps(coverage, reference_map)
    first = next((gap for gap in gaps if not gap.all_around), None)
    lines += [_said(gap, gap is first, reference_map.gravity_aligned) for gap in gaps[:_MOST_SAID]]
    poor = poor_places(coverage)
    if len(poor) == len(coverage.places_world) and len(poor) > 1:
        lines.append("from no place does it do so in half of them: take more photographs everywhere")
    elif not gaps:
        for x, y, _ in _spread(poor):
            lines.append(f"photograph from here too: around x = {x:.1f}{unit}, y = {y:.1f}{unit}, all around")
    return lines


def with_coverage(reference_map: ReferenceMap, coverage: Coverage) -> ReferenceMap:
    """The same map, whose summary says what it covers."""
    summary = {**reference_map.summary, "coverage": coverage_summary(coverage, reference_map)}
    return replace(reference_map, summary=summary)


def coverage_summary(coverage: Coverage, reference_map: ReferenceMap) -> dict[str, Any]:
    """The same as plain values, for ``map.yaml``."""
    poor = poor_places(coverage)
    by_azimuth = (coverage.share_by_direction * coverage.weights).sum(axis=0) / coverage.weights.sum(axis=0)
    return {
        "share": round(coverage.share, 3),
        "places": len(coverage.places_world),
        "enough_landmarks": coverage.enough,
        "share_by_azimuth_deg": {
            int(azimuth): round(float(share), 2)
            for azimuth, share in zip(coverage.azimuths_deg, by_azimuth, strict=True)
        },
        "gaps": [
            {
                "azimuth_deg": round(gap.azimuth_deg),
                "elevation_deg": round(gap.elevation_deg),
                "azimuths_deg": [round(edge) for edge in gap.azimuths_deg],
                "elevations_deg": [round(edge) for edge in gap.elevations_deg],
                "share": round(gap.share, 2),
                "landmarks": gap.seen,
            }
            for gap in find_gaps(coverage, reference_map)
        ],
        "poor_places": len(poor),
        "poorest": [[round(float(value), 2) for value in place] for place in _spread(poor)],
    }


def _said(gap: Gap, first: bool, upright: bool) -> str:
    low, high = gap.elevations_deg
    what = "this wall"
    if gap.all_around:
        what = "the ceiling" if low > 0.0 else "the floor" if high < 0.0 else "more"
        where = "all around"
    else:
        origin = "from the map's x axis, counter-clockwise as seen from above" if upright else "from the map's x axis"
        where = f"towards azimuth {gap.azimuth_deg:.0f} deg" + (f" ({origin})" if first else "")
        where += f", from {gap.azimuths_deg[0]:.0f} to {gap.azimuths_deg[1]:.0f} deg"
    return (
        f"photograph {what} too: {where}, elevation {low:.0f} to {high:.0f} deg; {100 * gap.share:.0f} % of the "
        f"places see enough there, {gap.seen} landmarks in the median. The nearest photograph, {gap.nearest}, looks "
        f"{gap.nearest_deg:.0f} deg away from it"
    )


def _gap(coverage: Coverage, reference_map: ReferenceMap, cells: NDArray[np.bool_]) -> Gap:
    elevations, azimuths = np.nonzero(cells)
    weights = coverage.weights[cells] * (1.0 - coverage.share_by_direction[cells])
    vectors = directions_level(coverage.elevations_deg[elevations], coverage.azimuths_deg[azimuths])
    mean = weights @ vectors
    elevation = float(weights @ coverage.elevations_deg[elevations] / weights.sum())
    azimuth = float(np.degrees(np.arctan2(mean[1], mean[0])))
    at_middle = cells[int(np.argmin(np.abs(coverage.elevations_deg - elevation)))]
    covered = at_middle if at_middle.any() else np.any(cells, axis=0)
    around = bool(covered.all())
    middle = directions_level(np.array(elevation), np.array(azimuth))
    forward_level = reference_map.world_T_camera[:, :3, 2] @ coverage.level_R_world.T
    if around:  # one of elevation alone
        away = np.abs(np.arcsin(np.clip(forward_level[:, 2], -1.0, 1.0)) - np.radians(elevation))
    else:
        away = np.arccos(np.clip(forward_level @ middle, -1.0, 1.0))
    nearest = int(np.argmin(away))
    return Gap(
        cells=cells,
        azimuth_deg=azimuth,
        elevation_deg=elevation,
        azimuths_deg=(-180.0, 180.0) if around else _arc(coverage.azimuths_deg, covered),
        elevations_deg=(
            float(coverage.elevations_deg[elevations].min()),
            float(coverage.elevations_deg[elevations].max()),
        ),
        share=float(coverage.registers[:, cells].mean()),
        seen=int(np.median(coverage.seen[:, cells])),
        size=float(coverage.weights[cells].sum()),
        nearest=reference_map.image_names[nearest],
        nearest_deg=float(np.degrees(away[nearest])),
    )


def _groups(mask: NDArray[np.bool_]) -> Iterator[NDArray[np.bool_]]:
    """Connected parts of a mask (E, A) whose last column is beside its first."""
    labels, count = label(mask)
    for left, right in zip(labels[:, 0], labels[:, -1], strict=True):
        if left and right and left != right:
            labels[labels == right] = left
    for group in range(1, count + 1):
        if (cells := labels == group).any():
            yield cells


def _arc(azimuths_deg: NDArray[np.float64], covered: NDArray[np.bool_]) -> tuple[float, float]:
    """First and last azimuth (-180 to 180, counter-clockwise) of those covered: what the longest gap leaves."""
    at = np.flatnonzero(covered)
    steps = np.diff(np.append(at, at[0] + len(covered)))
    after = int(np.argmax(steps))
    return float(azimuths_deg[at[(after + 1) % len(at)]]), float(azimuths_deg[at[after]])


def _spread(places: NDArray[np.float64]) -> list[NDArray[np.float64]]:
    """Some of the places, none near another."""
    named: list[NDArray[np.float64]] = []
    for place in places:
        if len(named) < _MOST_SAID and all(np.linalg.norm(place[:2] - other[:2]) > _APART_M for other in named):
            named.append(place)
    return named
