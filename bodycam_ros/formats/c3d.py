"""C3D: virtual markers over time, in millimetres, z up unless asked otherwise, for motion laboratories.

Where nobody solved, in a gap, markers are missing as C3D has it. ezc3d writes it.
"""

import io
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros import __version__
from bodycam_ros.errors import OutputError, RecordingError
from bodycam_ros.formats import c3d_worker
from bodycam_ros.formats.axes import UP_AXES
from bodycam_ros.formats.captured_motion import Y_UP_TO_Z_UP, CapturedMotion
from bodycam_ros.formats.markers import marker_places, markers_on
from bodycam_ros.formats.motion_text import checked_stamps
from bodycam_ros.formats.options import MotionOptions
from bodycam_ros.formats.sampled_motion import SampledMotion
from bodycam_ros.shown import printable, shown

SOFTWARE = "bodycam_ros"

_TO_MM = 1000.0
_MOST_FRAMES = 65_535  # the format counts them in 16 bits
_ON_SCREEN = {"y": ("+X", "+Y"), "z": ("+X", "+Z")}
"""Axis that is up -> those that programs draw to the right and upwards."""


def c3d(motion: SampledMotion, options: MotionOptions) -> bytes:
    """The motion as a C3D file.

    Raises:
        OutputError: ezc3d is not installed.
        RecordingError: more frames than the format can count.
    """
    up = options.up or "z"
    frames, markers = len(motion.stamps_ns), markers_on(motion)
    if frames > _MOST_FRAMES:
        raise RecordingError(
            f"{motion.name}: {frames} frames are more than the {_MOST_FRAMES} that C3D counts; choose a lower --rate, "
            "or trc"
        )
    places = _TO_MM * marker_places(motion, markers) @ UP_AXES[up].T
    places[~motion.known] = np.nan
    points = np.ones((4, len(markers), frames))
    points[:3] = places.transpose(2, 1, 0)
    points[3, :, ~motion.known] = np.nan
    written = _empty()
    written["parameters"]["POINT"]["RATE"]["value"] = [motion.rate]
    written["parameters"]["POINT"]["LABELS"]["value"] = [marker.name for marker in markers]
    written["parameters"]["POINT"]["DESCRIPTIONS"]["value"] = [f"on {marker.segment}" for marker in markers]
    written["parameters"]["POINT"]["UNITS"]["value"] = ["mm"]
    written.add_parameter("POINT", "X_SCREEN", [_ON_SCREEN[up][0]])
    written.add_parameter("POINT", "Y_SCREEN", [_ON_SCREEN[up][1]])
    written.add_parameter("MANUFACTURER", "SOFTWARE", [SOFTWARE])
    written.add_parameter("MANUFACTURER", "VERSION_LABEL", [__version__])
    written["data"]["points"] = points
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "motion.c3d"
        written.write(str(path))
        return path.read_bytes()


def _empty() -> Any:
    try:
        import ezc3d  # here: no other format needs it
    except ImportError as error:
        raise OutputError("c3d is written by ezc3d, which is not installed: pip install ezc3d") from error
    return ezc3d.c3d()


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
