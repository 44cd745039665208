"""C3D: virtual markers over time, in millimetres, z up by default, for motion laboratories.

In a gap markers are missing. Written and read by ezc3d.
"""

import io
import logging
import subprocess
import sys
import tempfile
import zipfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros import __version__
from bodycam_ros.errors import RecordingError
from bodycam_ros.files.shown import printable, shown
from bodycam_ros.formats import c3d_worker
from bodycam_ros.formats.captured_motion import Y_UP_TO_Z_UP, CapturedMotion, checked_stamps
from bodycam_ros.formats.markers import marker_positions, place_markers
from bodycam_ros.formats.missing_values import without_missing
from bodycam_ros.formats.sampled_motion import UP_AXES, MotionOptions, SampledMotion

logger = logging.getLogger(__name__)

SOFTWARE = "bodycam_ros"

_TO_MM = 1000.0
_MOST_FRAMES = 65_535  # the format counts them in 16 bits
_ON_SCREEN = {"y": ("+X", "+Y"), "z": ("+X", "+Z")}
"""Axis that is up -> those that programs draw to the right and upwards."""


def write_c3d(motion: SampledMotion, options: MotionOptions) -> bytes:
    """The motion as a C3D file.

    Raises:
        RecordingError: more frames than the format can count.
    """
    up = options.up or "z"
    frames, markers = len(motion.stamps_ns), place_markers(motion)
    if frames > _MOST_FRAMES:
        raise RecordingError(
            f"{motion.name}: {frames} frames are more than the {_MOST_FRAMES} that C3D counts; choose a lower --rate, "
            "or trc"
        )
    positions = _TO_MM * marker_positions(motion, markers) @ UP_AXES[up].T
    positions[~motion.known] = np.nan
    points = np.ones((4, len(markers), frames))
    points[:3] = positions.transpose(2, 1, 0)
    points[3, :, ~motion.known] = np.nan
    import ezc3d  # here: no other format needs it

    written = ezc3d.c3d()
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


_UNITS_M = {"m": 1.0, "cm": 0.01, "mm": 0.001, "in": 0.0254, "mete": 1.0, "metr": 1.0, "cent": 0.01, "mill": 0.001,
            "inch": 0.0254}  # fmt: skip
"""By the first four letters: some programs write words, and keep no more of them."""

_MAGIC = 0x50
"""The second byte of every C3D."""

_BLOCK = 512
_LONGEST_S, _LONGEST_S_PER_MB = 30.0, 2.0
_MOST_BYTES, _MOST_TIMES = 4 * 1024**3, 60
"""Bounds of memory: for whoever reads, and as many times the file's size besides."""


def read_c3d(path: Path) -> CapturedMotion:
    """Markers by label, at the rate of the file; time counts from its first frame.

    A marker is missing where its residual is negative, and as ``missing_values`` has it. A file that is longer than its
    header can count is read to its end.

    Raises:
        ValueError: it cannot be read, or has no markers.
    """
    content = _content(path)
    positions = content["positions"]
    rate = float(content["rate"])
    unit = str(content["unit"])
    metres = _UNITS_M.get(unit[:4])
    if metres is None:
        raise ValueError(f"unknown unit POINT:UNITS {shown(unit)}; known are m, cm, mm, in")
    if len(positions) == 0 or positions.shape[1] < 2 or not rate > 0.0:
        raise ValueError(
            f"it has {len(positions)} markers, {positions.shape[1]} frames, {rate:g} a second; a motion has more"
        )
    if unread := int(content["unread"]):
        logger.warning(
            "%s: its data have %d frames more than its header says, which are not read; if they are of this motion, "
            "write it anew with TRIAL:ACTUAL_END_FIELD, or as TRC",
            path,
            unread,
        )
    elif (stated := int(content["stated"])) > positions.shape[1]:
        logger.warning(
            "%s: its header says %d frames, it has %d; these are read; copy it again to have all",
            path,
            stated,
            positions.shape[1],
        )
    positions = metres * without_missing(positions)
    # Few files have the axis that is up; the others mean z.
    if str(content["up"]).endswith("Y"):
        positions = positions @ Y_UP_TO_Z_UP.T
    seen = dict(zip(content["labels"].tolist(), positions, strict=False))
    points = {name: values for name, values in seen.items() if name and np.isfinite(values).any()}
    if not points:
        raise ValueError("it has no marker that was seen")
    return CapturedMotion(path, "C3D", checked_stamps(np.arange(positions.shape[1]) / rate), points)


def _content(path: Path) -> Mapping[str, Any]:
    """Arrays of the file, by ``c3d_worker``.

    Raises:
        ValueError: it is not there, no C3D, or so damaged that it cannot be read.
    """
    try:
        with path.open("rb") as file:
            start = file.read(_BLOCK)
        size = path.stat().st_size
    except OSError as error:
        raise ValueError(error.strerror or error) from error
    if len(start) < _BLOCK or start[1] != _MAGIC:
        raise ValueError(f"it is no C3D file: those are longer than {_BLOCK} bytes, and the second is 0x50")
    longest_s = _LONGEST_S + _LONGEST_S_PER_MB * 1e-6 * size
    command = [sys.executable, "-P", c3d_worker.__file__, str(path), str(_MOST_BYTES + _MOST_TIMES * size)]
    try:
        done = subprocess.run(command, capture_output=True, stdin=subprocess.DEVNULL, timeout=longest_s, check=False)
    except subprocess.TimeoutExpired as error:
        raise ValueError(f"no end of it after {longest_s:.0f} s") from error
    if done.returncode != 0:
        lines = done.stderr.decode("utf-8", "replace").strip().splitlines()
        raise ValueError(printable((lines or ["the reader ended, as if it were damaged"])[-1][:200]))
    try:
        return dict(np.load(io.BytesIO(done.stdout), allow_pickle=False))
    except (OSError, zipfile.BadZipFile) as error:
        raise ValueError("its content is damaged") from error
