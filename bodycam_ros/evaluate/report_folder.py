"""Writes an evaluation into a folder: all of its files or none."""

import json
import os
import shutil
import tempfile
from collections.abc import Sequence
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.overlay import OverlayView
from bodycam_ros.evaluate.overlay_picture import draw_overlays
from bodycam_ros.evaluate.summary import summary
from bodycam_ros.evaluate.summary_picture import draw_summary

FIGURES, PICTURE, OVERLAY = "summary.json", "summary.png", "overlay.png"


def check_report_folder(folder: Path) -> None:
    """Refuse a place that cannot become a report folder, before the work is done.

    Raises:
        RecordingError: it is a file, or a bag, which a report has no business in.
    """
    if folder.exists() and not folder.is_dir():
        raise RecordingError(f"{folder}: is a file; give a folder for {FIGURES} and {PICTURE}")
    if (folder / "metadata.yaml").exists():
        raise RecordingError(f"{folder}: is a ros2 bag folder; give another folder for {FIGURES} and {PICTURE}")


def write_report(evaluation: Evaluation, folder: Path, overlay: Sequence[OverlayView] = ()) -> None:
    """Write ``summary.json``, ``summary.png`` and, if there are views, ``overlay.png``; earlier ones are replaced.

    Raises:
        RecordingError: the folder cannot be written.
    """
    check_report_folder(folder)
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
        scratch = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder.parent))
        try:
            (scratch / FIGURES).write_text(json.dumps(summary(evaluation), indent=1, allow_nan=False) + "\n")
            draw_summary(evaluation, scratch / PICTURE)
            if overlay:
                draw_overlays(overlay, scratch / OVERLAY)
            folder.mkdir(exist_ok=True)
            for file in sorted(scratch.iterdir()):
                os.replace(file, folder / file.name)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be written: {error.strerror or error}") from error
