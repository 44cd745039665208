"""Table and file of the clocks of all cameras.

reference: waist_front           camera whose media time is the recording's
cameras:
  head:
    start_s: -2.0555             recording_s = start_s + (1 + drift_ppm / 1e6) * media_s
    start_sigma_s: 0.0013        standard deviation, the travel of sound included
    drift_ppm: 3.1
    drift_sigma_ppm: 31.0
    source: sound                sound, motion, telemetry or given
    confidence: 0.49             0 to 1: lead over the second best start; 1 of a given one
unplaced: {foot_left: has no sound}
remarks: []
"""

from pathlib import Path
from typing import Any

import yaml
from rich.box import SIMPLE_HEAD
from rich.table import Table

from bodycam_ros.ingest.camera_offsets import Offsets
from bodycam_ros.whole_file import failure_named, whole_files, write_whole

_PPM, _MS = 1e6, 1e3


def timing_table(offsets: Offsets) -> Table:
    """A row per camera, in the order in which they started."""
    table = Table(title="clocks of the cameras", box=SIMPLE_HEAD, padding=(0, 1, 0, 0), pad_edge=False)
    table.add_column("camera", overflow="fold")
    for column in ("start\n[s]", "sigma\n[ms]", "drift\n[ppm]", "sigma\n[ppm]"):
        table.add_column(column, justify="right", no_wrap=True)
    table.add_column("by", overflow="fold")
    table.add_column("confi-\ndence", justify="right", no_wrap=True)
    for name, time in sorted(offsets.times.items(), key=lambda item: item[1].start_s):
        if name == offsets.reference:
            table.add_row(name, "0.0000", "", "0.0", "", "reference", "")
            continue
        table.add_row(
            name,
            f"{time.start_s:+.4f}",
            f"{_MS * time.start_sigma_s:.1f}",
            f"{_PPM * time.drift:+.1f}",
            f"{_PPM * time.drift_sigma:.1f}",
            time.source,
            f"{offsets.confidence[name]:.2f}",
        )
    for name, why in offsets.unplaced.items():
        table.add_row(name, "unknown", "", "", "", why, "", style="red")
    return table


def write_timing_report(offsets: Offsets, folder: Path) -> None:
    """Write ``timing.yaml`` into a folder; an earlier one is replaced.

    Raises:
        OutputError: it cannot be written.
    """
    text = yaml.safe_dump(_document(offsets), sort_keys=False, allow_unicode=True, width=120)
    head = "# Clocks of the cameras: recording_s = start_s + (1 + drift_ppm / 1e6) * media_s\n"
    with whole_files(folder) as unfinished, failure_named(folder):
        write_whole(unfinished / "timing.yaml", head + text)


def _document(offsets: Offsets) -> dict[str, Any]:
    """The content of ``timing.yaml``, as described on top."""
    return {
        "reference": offsets.reference,
        "cameras": {
            name: {
                "start_s": round(time.start_s, 7),
                "start_sigma_s": round(time.start_sigma_s, 7),
                "drift_ppm": round(_PPM * time.drift, 3),
                "drift_sigma_ppm": round(_PPM * time.drift_sigma, 3),
                "source": time.source,
                "confidence": round(offsets.confidence[name], 3),
            }
            for name, time in offsets.times.items()
        },
        "unplaced": dict(offsets.unplaced),
        "remarks": list(offsets.remarks),
    }
