"""Whether a map's lengths are metres and its z is up: a body has no size without the one, no upright without the other.

The same for everybody who makes or solves a body: from a recording or live.
"""

from pathlib import Path

from bodycam_ros.errors import MapError
from bodycam_ros.registration.reference_map import ReferenceMap

_REMEDY = "build it with photographs of the AprilTag board (bodycam map)"


def check_metric(reference_map: ReferenceMap, path: Path) -> None:
    """Refuse a map without metres: in it a body and its accelerations have no size.

    Raises:
        MapError: the map, loaded from ``path``, is not metric.
    """
    if not reference_map.metric:
        raise MapError(f"{path}: this map is not metric, so a body has no size in it; {_REMEDY}")


def check_upright(reference_map: ReferenceMap, path: Path) -> None:
    """Refuse a map without metres or without a vertical: bones would have no length, and the N-pose no up.

    Raises:
        MapError: the map, loaded from ``path``, is not metric, or its z is not up.
    """
    check_metric(reference_map, path)
    if not reference_map.gravity_aligned:
        raise MapError(
            f"{path}: this map does not know what is up, so a body has no upright in it; {_REMEDY}, whose 'placement' "
            "says which of its axes is up"
        )


def assumed_vertical(reference_map: ReferenceMap, path: Path) -> str:
    """What is assumed where a body is solved in a map without a vertical; empty where the map has one."""
    if reference_map.gravity_aligned:
        return ""
    return (
        f"{path}: this map does not know what is up; the body is solved all the same, but z of the output is the "
        "board's z, and up only if the board lay flat"
    )
