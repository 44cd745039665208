"""The record of a stretch as a file in its bag: arrays without pickle, and the rest as JSON text among them."""

import io
import json
import zipfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import numpy as np

from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import RecordingError
from bodycam_ros.estimation.solver_counts import SolverCounts
from bodycam_ros.quality.camera_poses import CameraCount, LoggedPoses
from bodycam_ros.recording.bag_records import BagRecords
from bodycam_ros.replaying.camera_worker import UnusableImages
from bodycam_ros.replaying.replay_record import SolverOutcome, StretchRecord
from bodycam_ros.results.provenance import VERDICT_FILE
from bodycam_ros.timing.clock_state import ClockState

STRETCH_FILE = "stretch.npz"
"""Attachment of the bag of a stretch."""

_OTHERWISE = {"readouts", "unusable", "outcome", "poses"}  # fields that are no plain values
_MOST_BYTES = 1_000_000_000


def stretch_bytes(record: StretchRecord) -> bytes:
    """The record as an npz file."""
    poses, outcome = record.poses, record.outcome
    text = {
        **{name: value for name, value in vars(record).items() if name not in _OTHERWISE},
        "readouts": {camera: asdict(readout) for camera, readout in record.readouts.items()},
        "unusable": [asdict(item) for item in record.unusable],
        "counts": vars(outcome.counts),
        "frames": outcome.frames,
        "late": outcome.late,
        "clocks": {camera: [asdict(clock) for clock in clocks] for camera, clocks in outcome.clocks.items()},
        "remarks": outcome.remarks,
        "cameras": {camera: asdict(count) for camera, count in poses.counts.items()},
        "lens_images": {camera: images for camera, (images, _, _) in poses.lenses.items()},
    }
    arrays: dict[str, Any] = {"text": np.array(json.dumps(text)), "stamps_ns": poses.stamps_ns}
    arrays["segments"] = poses.segments
    arrays |= {f"registered/{camera}": own for camera, own in poses.registered.items()}
    for camera, (_, information, gradient) in poses.lenses.items():
        arrays[f"information/{camera}"], arrays[f"gradient/{camera}"] = information, gradient
    stream = io.BytesIO()
    np.savez_compressed(stream, **arrays)
    return stream.getvalue()


def read_stretch(path: Path, records: BagRecords) -> StretchRecord:
    """The record in the bag of a stretch.

    Args:
        path: of the bag, for messages.
        records: of the bag.

    Raises:
        RecordingError: it has none, or a damaged one.
    """
    content = records.attachments.get(STRETCH_FILE)
    if content is None or VERDICT_FILE in records.attachments:  # a bag of all stretches has the records of each
        raise RecordingError(f"{path}: is not the bag of a stretch; 'bodycam replay stretch' writes them")
    try:
        with zipfile.ZipFile(io.BytesIO(content)) as archive:
            if sum(entry.file_size for entry in archive.infolist()) > _MOST_BYTES:
                raise ValueError("too large")
        with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
            return _record(json.loads(str(arrays["text"])), arrays)
    except Exception as error:  # a damaged file can raise nearly anything in a parser
        raise RecordingError(
            f"{path}: its record of the stretch is damaged, or of another version: solve the stretch again"
        ) from error


def _record(text: dict[str, Any], arrays: Mapping[str, Any]) -> StretchRecord:
    stamps_ns, segments = arrays["stamps_ns"], arrays["segments"]
    registered = {camera: arrays[f"registered/{camera}"] for camera in text["cameras"]}
    if any(len(each) != len(stamps_ns) for each in (segments, *registered.values())):
        raise ValueError("rows differ")
    counts = SolverCounts(**{**text["counts"], "rejected": Counter(text["counts"]["rejected"])})
    clocks = {camera: tuple(ClockState(**clock) for clock in clocks) for camera, clocks in text["clocks"].items()}
    return StretchRecord(
        number=int(text["number"]),
        count=int(text["count"]),
        start_ns=int(text["start_ns"]),
        latest_ns=int(text["latest_ns"]),
        images=Counter(text["images"]),
        registered=Counter(text["registered"]),
        left_out=Counter(text["left_out"]),
        solved=int(text["solved"]),
        predicted=int(text["predicted"]),
        spans_ns={camera: (int(first), int(last)) for camera, (first, last) in text["spans_ns"].items()},
        readouts={camera: Readout(**readout) for camera, readout in text["readouts"].items()},
        unusable=tuple(UnusableImages(**item) for item in text["unusable"]),
        outcome=SolverOutcome(counts, text["frames"], text["late"], clocks, tuple(text["remarks"])),
        poses=LoggedPoses(
            stamps_ns,
            registered,
            segments,
            {camera: CameraCount(**count) for camera, count in text["cameras"].items()},
            {
                camera: (images, arrays[f"information/{camera}"], arrays[f"gradient/{camera}"])
                for camera, images in text["lens_images"].items()
            },
        ),
    )
