"""Clocks of all cameras as a file, written and read; clocks of genlocked cameras.

reference: waist_front           camera whose media time is the recording's
cameras:
  head:
    start_s: -2.0555             recording_s = start_s + (1 + drift_ppm / 1e6) * media_s
    start_sigma_s: 0.0013        standard deviation, the travel of sound included
    drift_ppm: 3.1
    drift_sigma_ppm: 31.0
    source: sound                sound, motion or given
    confidence: 0.49             0 to 1: lead over the second best start; 1 of a given one
unplaced: {foot_left: has no sound}
remarks: []
"""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import yaml

from bodycam_ros.errors import RecordingError
from bodycam_ros.files.shown import shown
from bodycam_ros.files.whole_file import failure_named, whole_files, write_whole
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.ingest.camera_offsets import Offsets
from bodycam_ros.ingest.camera_remarks import remark_lines
from bodycam_ros.ingest.clock_fit import CameraTime, relative_to

TIMING_FILE = "timing.yaml"
_PPM = 1e6

_UNSTATED = {"drift_ppm": 0.0, "start_sigma_s": 0.001, "drift_sigma_ppm": 20.0}  # of an offset without them in the file
_LARGEST_S = 1e6


def synchronous_offsets(cameras: Sequence[str]) -> Offsets:
    """Clocks of genlocked cameras, whose files all start with the same frame.

    Raises:
        RecordingError: a camera was stopped in between, so its next file starts at an unknown time.
    """
    if parts := [name for name in cameras if ", part " in name]:
        raise RecordingError(
            f"{', '.join(parts)}: files do not follow each other without a gap, so it is unknown when the later ones "
            "started; give the starts with --offsets"
        )
    return Offsets(cameras[0], {name: CameraTime() for name in cameras})


def read_offsets(path: Path, cameras: Sequence[str]) -> Offsets:
    """Clocks from a YAML file: ``camera: start [s]``, or a ``timing.yaml`` that an ingest wrote.

    A start is the time of the recording at which the camera's file starts; larger is later.

    Raises:
        RecordingError: it cannot be read, or has no camera of the recording.
    """
    document = read_yaml(path, "file of offsets", RecordingError)
    entries: Any = document.get("cameras", document) if isinstance(document, Mapping) else None
    if not isinstance(entries, Mapping):
        raise RecordingError(f"{path}: expected lines 'camera: seconds', or a timing.yaml of bodycam ingest")
    times = {name: _camera_time(path, name, entries[name]) for name in cameras if name in entries}
    if not times:
        raise RecordingError(
            f"{path}: has none of the cameras {', '.join(cameras)}, but {', '.join(map(str, entries)) or 'none'}"
        )
    reference = next((name for name, time in times.items() if time.start_s == 0.0), next(iter(times)))
    unplaced = {name: f"{path} has no offset of it" for name in cameras if name not in times}
    return Offsets(reference, relative_to(reference, times), unplaced)


def _camera_time(path: Path, name: str, entry: Any) -> CameraTime:
    fields = _UNSTATED | (dict(entry) if isinstance(entry, Mapping) else {"start_s": entry})
    numbers = []
    for field in ("start_s", "drift_ppm", "start_sigma_s", "drift_sigma_ppm"):
        value: Any = fields.get(field)
        if type(value) not in (int, float) or not abs(value) < _LARGEST_S:
            raise RecordingError(f"{path}: {field} of camera {name} must be a number, not {shown(value)}")
        numbers.append(float(value))
    start_s, drift_ppm, start_sigma_s, drift_sigma_ppm = numbers
    return CameraTime(start_s, drift_ppm / _PPM, start_sigma_s, drift_sigma_ppm / _PPM)


def timing_text(offsets: Offsets) -> str:
    """Text of ``timing.yaml``, as described on top."""
    document = {
        "reference": offsets.reference,
        "cameras": {
            name: {
                "start_s": round(time.start_s, 7) + 0.0,
                "start_sigma_s": round(time.start_sigma_s, 7),
                "drift_ppm": round(_PPM * time.drift, 3) + 0.0,
                "drift_sigma_ppm": round(_PPM * time.drift_sigma, 3),
                "source": time.source,
                "confidence": round(time.confidence, 3),
            }
            for name, time in offsets.times.items()
        },
        "unplaced": dict(offsets.unplaced),
        "remarks": remark_lines(offsets.remarks),
    }
    text = yaml.safe_dump(document, sort_keys=False, allow_unicode=True, width=120)
    return f"# Clocks of the cameras: recording_s = start_s + (1 + drift_ppm / 1e6) * media_s\n{text}"


def write_timing_report(offsets: Offsets, folder: Path) -> None:
    """Write ``timing.yaml`` into a folder; an earlier one is replaced.

    Raises:
        OutputError: it cannot be written.
    """
    with whole_files(folder) as unfinished, failure_named(folder):
        write_whole(unfinished / TIMING_FILE, timing_text(offsets))
