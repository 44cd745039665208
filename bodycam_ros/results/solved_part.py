"""A part of what was solved, by the recording's own time."""

from dataclasses import replace
from typing import TypeVar

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.errors import RecordingError
from bodycam_ros.recording.time_span import TimeSpan
from bodycam_ros.results.provenance import RECORDING, Provenance
from bodycam_ros.results.solved_body import SolvedBody
from bodycam_ros.results.solved_recording import CameraRecord, SolvedRecording, StaticCameraRecord

S = TypeVar("S", bound=SolvedBody)
R = TypeVar("R", CameraRecord, StaticCameraRecord)


def part_of(solved: S, span: TimeSpan) -> S:
    """The states, images and measurements of a part.

    Args:
        solved: what was solved.
        span: in seconds since the first image of the recording; of a bag that does not have its stamp, since the first
            state.

    Raises:
        RecordingError: nothing was solved in that time.
    """
    if span == TimeSpan():
        return solved
    zero_ns = recording_start_ns(solved)
    window_ns = span.window_ns(zero_ns)
    rows = _inside(solved.stamps_ns, window_ns)
    if not rows.any():
        first_s, last_s = (1e-9 * (int(stamp) - zero_ns) for stamp in solved.stamps_ns[[0, -1]])
        raise RecordingError(
            f"{solved.path}: nothing was solved {span.text}; it was solved from {first_s:.1f} to {last_s:.1f} s"
        )
    part = replace(
        solved,
        stamps_ns=solved.stamps_ns[rows],
        joint_angles=solved.joint_angles[rows],
        world_T_root=solved.world_T_root[rows],
        root_covariance=solved.root_covariance[rows],
    )
    if isinstance(part, SolvedRecording):
        cameras = tuple(_camera_part(record, window_ns) for record in part.cameras)
        stations = tuple(_station_part(record, window_ns) for record in part.stations)
        part = replace(
            part,
            cameras=tuple(record for record in cameras if len(record.stamps_ns)),
            stations=tuple(record for record in stations if len(record.stamps_ns)),
        )
    return part


def recording_start_ns(solved: SolvedBody) -> int:
    """Stamp of the first image of the recording, by the record of the bag; else of the first state [ns]."""
    record = Provenance.read(solved.path).records.metadata.get(RECORDING, {})
    stamp = record.get("first_stamp_ns", "")
    return int(stamp) if stamp.isdecimal() else int(solved.stamps_ns[0])


def _inside(stamps_ns: NDArray[np.int64], window_ns: tuple[int, int]) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = (stamps_ns >= window_ns[0]) & (stamps_ns < window_ns[1])
    return inside


def _camera_part(record: CameraRecord, window_ns: tuple[int, int]) -> CameraRecord:
    rows = _inside(record.stamps_ns, window_ns)
    return replace(
        record,
        stamps_ns=record.stamps_ns[rows],
        landmarks=record.landmarks[rows],
        world_T_camera=record.world_T_camera[rows],
        sights=record.sights[rows],
    )


def _station_part(record: StaticCameraRecord, window_ns: tuple[int, int]) -> StaticCameraRecord:
    rows = _inside(record.stamps_ns, window_ns)
    return replace(
        record, stamps_ns=record.stamps_ns[rows], segments=record.segments[rows], confidence=record.confidence[rows]
    )
