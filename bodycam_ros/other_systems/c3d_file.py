"""Markers in C3D, the biomechanist's format; ezc3d reads it."""

from pathlib import Path

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.other_systems.captured_motion import Y_UP_TO_Z_UP, CapturedMotion
from bodycam_ros.other_systems.motion_text import checked_stamps
from bodycam_ros.shown import shown

_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
_MAGIC = 0x50
"""The second byte of every C3D."""

_BLOCK = 512


def captured_c3d(path: Path) -> CapturedMotion:
    """Markers by label, at the rate that the file says; time counts from its first frame.

    A marker was not seen where its residual is negative, or where it lies exactly at the origin, as many programs
    write what they lack.

    Raises:
        RecordingError: it cannot be read, or has no markers.
    """
    _check_kind(path)
    import ezc3d  # loads a library of its own: only who has such a file needs it

    try:
        file = ezc3d.c3d(str(path))
        parameters, data = file["parameters"]["POINT"], file["data"]
        places = np.asarray(data["points"], np.float64)[:3].transpose(1, 2, 0)  # (N, K, 3)
        rate = float(parameters["RATE"]["value"][0])
        units = parameters.get("UNITS", {}).get("value") or ["mm"]
        labels = _labels(parameters)
    except RecordingError:
        raise
    except Exception as error:  # whatever its C++ throws
        raise RecordingError(f"{path}: cannot be read as C3D: {shown(str(error))}") from error
    if str(units[0]).strip().lower() not in _METRES:
        raise RecordingError(f"{path}: unknown unit POINT:UNITS {shown(units[0])}; known are {', '.join(_METRES)}")
    if len(places) == 0 or places.shape[1] < 2 or not rate > 0.0:
        raise RecordingError(
            f"{path}: has {len(places)} markers, {places.shape[1]} frames, {rate:g} a second; a motion has more"
        )
    unit = _METRES[str(units[0]).strip().lower()]
    places = places * unit
    places[(places == 0.0).all(axis=2)] = np.nan
    # A force platform's files say which axis is up; most have none and mean z.
    if _up(parameters).endswith("Y"):
        places = places @ Y_UP_TO_Z_UP.T
    seen = dict(zip(labels, places, strict=False))
    points = {name: of for name, of in seen.items() if name and np.isfinite(of).any()}
    return CapturedMotion(
        path, "C3D", checked_stamps(np.asarray(np.arange(places.shape[1]) / rate, np.float64)), points
    )


def _check_kind(path: Path) -> None:
    """Refuse what is no C3D before a library in C++ trusts its numbers.

    Raises:
        RecordingError: so it is.
    """
    try:
        with path.open("rb") as file:
            start = file.read(_BLOCK)
    except OSError as error:
        raise RecordingError(f"{path}: cannot read this C3D file: {error.strerror or error}") from error
    if len(start) < _BLOCK or start[1] != _MAGIC:
        raise RecordingError(f"{path}: is no C3D file: those are longer than {_BLOCK} bytes, and the second is 0x50")


def _labels(parameters: "dict[str, dict[str, list[str]]]") -> list[str]:
    """Names of the markers; those beyond the 255th are in LABELS2 and so on."""
    more = sorted((key for key in parameters if key.startswith("LABELS")), key=lambda key: int(key[6:] or "1"))
    return [str(label).strip() for key in more for label in parameters[key]["value"]]


def _up(parameters: "dict[str, dict[str, list[str]]]") -> str:
    value = parameters.get("Y_SCREEN", {}).get("value") or ["+Z"]
    return str(value[0]).strip().upper()
