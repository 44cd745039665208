"""C3D: virtual markers over time, in millimetres, z up unless asked otherwise, for motion laboratories.

Where nobody solved, in a gap, markers are missing as C3D has it. ezc3d writes it.
"""

import tempfile
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros import __version__
from bodycam_ros.errors import OutputError, RecordingError
from bodycam_ros.export.axes import UP_AXES
from bodycam_ros.export.markers import marker_places, markers_on
from bodycam_ros.export.options import MotionOptions
from bodycam_ros.export.sampled_motion import SampledMotion

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
