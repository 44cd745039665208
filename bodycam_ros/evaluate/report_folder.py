"""Writes an evaluation into a folder: all of its files or none."""

import json
import os
import shutil
import tempfile
from pathlib import Path

from bodycam_ros.errors import RecordingError
from bodycam_ros.evaluate.evaluation import Evaluation
from bodycam_ros.evaluate.summary import summary
from bodycam_ros.evaluate.summary_picture import draw_summary

FIGURES, PICTURE = "summary.json", "summary.png"


def check_report_folder(folder: Path) -> None:
    """Refuse a place that cannot become a report folder, before the work is done.

    Raises:
        RecordingError: it is a file, or a bag, which a report has no business in.
    """
    if folder.exists() and not folder.is_dir():
        raise RecordingError(f"{folder}: is a file; give a folder for {FIGURES} and {PICTURE}")
    if (folder / "metadata.yaml").exists():
        raise RecordingError(f"{folder}: is a ros2 bag folder; give another folder for {FIGURES} and {PICTURE}")


def write_report(evaluation: Evaluation, folder: Path) -> None:
    """Write ``summary.json`` and ``summary.png``; those of an earlier evaluation are replaced.

    Raises:
        RecordingError: the folder cannot be written.
    """
    check_report_folder(folder)
    try:
        folder.mkdir(parents=True, exist_ok=True)
        scratch = Path(tempfile.mkdtemp(prefix=f".{folder.name}.", dir=folder))
        try:
            (scratch / FIGURES).write_text(json.dumps(summary(evaluation), indent=1, allow_nan=False) + "\n")
            draw_summary(evaluation, scratch / PICTURE)
            for name in (FIGURES, PICTURE):
                os.replace(scratch / name, folder / name)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)
    except OSError as error:
        raise RecordingError(f"{folder}: cannot be written: {error.strerror or error}") from error
