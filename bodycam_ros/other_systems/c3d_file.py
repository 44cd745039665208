"""Markers in C3D, the biomechanist's format; ezc3d reads it, in a process of its own."""

import io
import subprocess
import sys
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.errors import RecordingError
from bodycam_ros.other_systems import c3d_worker
from bodycam_ros.other_systems.captured_motion import Y_UP_TO_Z_UP, CapturedMotion
from bodycam_ros.other_systems.motion_text import checked_stamps
from bodycam_ros.shown import printable, shown

_METRES = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254}
_METRES_IN_WORDS = {"mete": 1.0, "metr": 1.0, "cent": 0.01, "mill": 0.001, "inch": 0.0254}
"""By the first four letters: some programs write words, and keep no more of them."""

_MAGIC = 0x50
"""The second byte of every C3D."""

_BLOCK = 512
_LONGEST_S, _LONGEST_S_PER_MB = 30.0, 2.0
_MOST_BYTES, _MOST_TIMES = 4 * 1024**3, 60
"""Of memory: for whoever reads, and as many times the file's size besides."""


def captured_c3d(path: Path) -> CapturedMotion:
    """Markers by label, at the rate that the file says; time counts from its first frame.

    A marker was not seen where its residual is negative, or where it lies exactly at the origin, as many programs
    write what they lack.

    Raises:
        RecordingError: it cannot be read, or has no markers.
    """
    content = _content(path)
    places, rate, unit = content["places"], float(content["rate"]), str(content["unit"])
    metres = _METRES.get(unit) or _METRES_IN_WORDS.get(unit[:4])
    if metres is None:
        raise RecordingError(f"{path}: unknown unit POINT:UNITS {shown(unit)}; known are {', '.join(_METRES)}")
    if len(places) == 0 or places.shape[1] < 2 or not rate > 0.0:
        raise RecordingError(
            f"{path}: has {len(places)} markers, {places.shape[1]} frames, {rate:g} a second; a motion has more"
        )
    places = places * metres
    places[~np.isfinite(places).all(axis=2) | (places == 0.0).all(axis=2)] = np.nan
    # Files of force platforms say which axis is up; most have none and mean z.
    if str(content["up"]).endswith("Y"):
        places = places @ Y_UP_TO_Z_UP.T
    seen = dict(zip(content["labels"].tolist(), places, strict=False))
    points = {name: of for name, of in seen.items() if name and np.isfinite(of).any()}
    if not points:
        raise RecordingError(f"{path}: has no marker that was seen")
    try:
        stamps_ns = checked_stamps(np.asarray(np.arange(places.shape[1]) / rate, np.float64))
    except ValueError as error:
        raise RecordingError(f"{path}: cannot be read as C3D: {rate:g} frames a second: {error}") from error
    return CapturedMotion(path, "C3D", stamps_ns, points)


def _content(path: Path) -> Mapping[str, Any]:
    """What is in the file.

    Raises:
        RecordingError: it is not there, no C3D, or so damaged that it cannot be read.
    """
    try:
        with path.open("rb") as file:
            start = file.read(_BLOCK)
        size = path.stat().st_size
    except OSError as error:
        raise RecordingError(f"{path}: cannot read this C3D file: {error.strerror or error}") from error
    if len(start) < _BLOCK or start[1] != _MAGIC:
        raise RecordingError(f"{path}: is no C3D file: those are longer than {_BLOCK} bytes, and the second is 0x50")
    longest_s = _LONGEST_S + _LONGEST_S_PER_MB * 1e-6 * size
    command = [sys.executable, "-P", c3d_worker.__file__, str(path), str(_MOST_BYTES + _MOST_TIMES * size)]
    try:
        done = subprocess.run(command, capture_output=True, stdin=subprocess.DEVNULL, timeout=longest_s, check=False)
    except subprocess.TimeoutExpired as error:
        raise RecordingError(f"{path}: cannot be read as C3D: no end of it after {longest_s:.0f} s") from error
    if done.returncode != 0:
        told = done.stderr.decode("utf-8", "replace").strip().splitlines() or [
            "the reader ended, as if it were damaged"
        ]
        raise RecordingError(f"{path}: cannot be read as C3D: {printable(told[-1][:200])}")
    try:
        return dict(np.load(io.BytesIO(done.stdout), allow_pickle=False))
    except (ValueError, OSError, zipfile.BadZipFile) as error:
        raise RecordingError(f"{path}: cannot be read as C3D: what is in it makes no sense") from error
