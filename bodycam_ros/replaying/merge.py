"""Stretches of a recording that were solved one by one, brought together: one bag, one verdict.

The bag's files are those of the stretches, unread, between one with what is known at the beginning (the robot, the
clocks) and one with what is known at the end (the verdict). So a merge takes a moment, however long the recording.
"""

import os
import shutil
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from functools import partial
from pathlib import Path
from typing import Any

import yaml

from bodycam_ros.body.body_file import read_body
from bodycam_ros.errors import MapError, RecordingError
from bodycam_ros.files.whole_file import failure_named, whole_folder
from bodycam_ros.files.yaml_file import read_yaml
from bodycam_ros.messages.factory import Message
from bodycam_ros.quality.camera_poses import CameraPoseLog
from bodycam_ros.recording.bag_file import METADATA
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.recording.bag_records import PROGRAM, BagRecords, read_bag_records
from bodycam_ros.recording.bag_writer import RecordingWriter, check_replaceable, write_recording
from bodycam_ros.recording.mcap_storage import ROSBAG2_RECORD
from bodycam_ros.replaying.camera_worker import UnusableImages
from bodycam_ros.replaying.first_pass import FirstPass
from bodycam_ros.replaying.replay_output import ReplayOutput
from bodycam_ros.replaying.replay_record import StretchRecord
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.replaying.replay_summary import ReplaySummary
from bodycam_ros.replaying.stretch_file import read_stretch
from bodycam_ros.results.provenance import BODY, BODY_FILE, MAP, RECORDING, SETTINGS, body_record

_BAG = "rosbag2_bagfile_information"
_SAME = (BODY, MAP, RECORDING, SETTINGS)


def merge_stretches(request: ReplayRequest, first: FirstPass, parts: Sequence[Path]) -> ReplaySummary:
    """Bring the bags of all stretches together.

    Args:
        request: as of the stretches; ``output`` is the bag to be.
        first: the first pass that the stretches were solved by.
        parts: their bags, in any order.

    Raises:
        RecordingError: a stretch is missing, there twice, damaged, or was solved of other inputs than the others; or it
            was with another body or recording.
        MapError: nothing was solved in any of them.
        OutputError: the bag cannot be written.
    """
    records = {path: read_bag_records(path) for path in parts}
    stretches = sorted(((read_stretch(path, records[path]), path) for path in parts), key=lambda s: s[0].number)
    _check(first, stretches, records)
    ordered = [stretch for stretch, _ in stretches]
    body = read_body(request.body)
    if body_record(body) != records[stretches[0][1]].metadata.get(BODY):
        raise RecordingError(f"{stretches[0][1]}: was solved with another body than {request.body}; give that body")
    with open_recording(request.recording, request.names) as recording:
        mounted = [camera for camera in recording.cameras if camera in body.mounts]
        first.check_recording(request.recording, recording.first_stamp_ns)
        cameras = {camera: recording.camera_model(camera) for camera in mounted}
        not_read = _not_read(recording, mounted, ordered, first)
        clock_sigma_s = max(map(recording.clock_sigma, recording.cameras))
    summary = ReplaySummary(1e-9 * (first.bounds_ns[-1] - first.bounds_ns[0]), clock_sigma_s=clock_sigma_s)
    summary.notes = request.left_out_of_parts
    log = CameraPoseLog(body, cameras, request.settings.pose_fit.inlier_px, start_ns=first.recording[1] or None)
    with whole_folder(request.output, partial(check_replaceable, request.force)) as unfinished:
        unfinished.mkdir()
        with _ends(unfinished, first.bounds_ns[0] + 1) as ends:
            out = ReplayOutput(ends, body, dict, log, cameras, (), None, None, summary)
            outcome = ordered[0].outcome
            for number, stretch in enumerate(ordered):
                out.extend(stretch)
                outcome = outcome.followed_by(stretch.outcome) if number else outcome
            if not summary.solved:
                raise MapError(
                    f"no camera of {request.recording} could be registered in {request.map} in any stretch; check "
                    "that this is the map of the place, and that the images are neither dark nor blurred"
                )
            if request.settings.images.max_rate:
                summary.left_out += not_read
            else:
                out.add_missing(_missing(not_read, ordered[-1].latest_ns))
            out.finish((), outcome)
            ends.copy_records(records[stretches[0][1]])
        _gather(unfinished, [path for _, path in stretches])
    return summary


def _check(
    first: FirstPass, stretches: Sequence[tuple[StretchRecord, Path]], records: Mapping[Path, BagRecords]
) -> None:
    """Refuse stretches that are not those of one recording, each of them once."""
    numbers = Counter(stretch.number for stretch, _ in stretches)
    missing = [str(number + 1) for number in range(first.count) if number not in numbers]
    twice = [str(number + 1) for number, count in sorted(numbers.items()) if count > 1]
    if missing or twice:
        which, what = (missing, "missing") if missing else (twice, "there twice")
        raise RecordingError(
            f"of the {first.count} stretches, {', '.join(which)} {'is' if len(which) == 1 else 'are'} {what} among "
            f"{len(stretches)} bags; give each once"
        )
    expected = {name: records[stretches[0][1]].metadata.get(name) for name in _SAME}
    for stretch, path in stretches:
        other = [name for name in _SAME if records[path].metadata.get(name) != expected[name]]
        if other or stretch.count != first.count:
            what = f"with another {other[0]}" if other else f"as one of {stretch.count}"
            raise RecordingError(f"{path}: was solved {what} than the other stretches; solve all of them alike")


def _not_read(
    recording: Recording, cameras: Sequence[str], stretches: Sequence[StretchRecord], first: FirstPass
) -> Counter[str]:
    """Camera -> images that no stretch has read; none of a recording of which a part is solved."""
    spans_ns = recording.camera_spans(cameras).values()
    if any(begin < first.bounds_ns[0] or end >= first.bounds_ns[-1] for begin, end in spans_ns):
        return Counter()
    read = Counter[str]()
    for stretch in stretches:
        read += stretch.images + Counter({item.camera: item.count for item in stretch.unusable})
    return Counter({camera: max(0, recording.image_count(camera) - read[camera]) for camera in cameras})


def _missing(counts: Mapping[str, int], stamp_ns: int) -> Iterator[UnusableImages]:
    for camera, count in sorted(counts.items()):
        if count:
            text = (
                f"camera {camera}: {count} images are in no stretch: they are missing, or were not recorded at the "
                "time of their stamps; 'bodycam doctor' says which"
            )
            yield UnusableImages(camera, stamp_ns, "missing", text, count)


class _Ends:
    """The first and the last file of a bag, to which messages go by their stamps."""

    def __init__(self, begin: RecordingWriter, end: RecordingWriter, from_ns: int) -> None:
        self._begin, self._end, self._from_ns = begin, end, from_ns

    def write(self, topic: str, stamp_ns: int, message: Message) -> None:
        """Append a message to one of them."""
        (self._begin if stamp_ns < self._from_ns else self._end).write(topic, stamp_ns, message)

    def write_serialized(self, topic: str, message_type: str, stamp_ns: int, cdr: bytes | memoryview) -> None:
        """Append a message that is CDR already."""
        (self._begin if stamp_ns < self._from_ns else self._end).write_serialized(topic, message_type, stamp_ns, cdr)

    def attach(self, name: str, media_type: str, content: str, stamp_ns: int = 0) -> None:
        """Append a file to the last."""
        self._end.attach(name, media_type, content, stamp_ns)

    def copy_records(self, records: BagRecords) -> None:
        """Append what a stretch was made from to the last."""
        for name, record in records.metadata.items():
            if name not in (PROGRAM, ROSBAG2_RECORD):
                self._end.add_metadata(name, record)
        if BODY_FILE in records.attachments:
            self._end.attach(BODY_FILE, "application/yaml", records.attachments[BODY_FILE])


@contextmanager
def _ends(folder: Path, from_ns: int) -> Iterator[_Ends]:
    """Bags in a folder for the first and the last file; messages from a stamp on [ns] go to the last."""
    with write_recording(folder / _BEGIN) as begin, write_recording(folder / _END) as end:
        yield _Ends(begin, end, from_ns)


_BEGIN, _END = "begin", "end"


def _gather(folder: Path, parts: Sequence[Path]) -> None:
    """Make one bag of the bags of stretches, which stay where they are, and of those in the folder."""
    digits = len(str(len(parts) + 1))
    documents = []
    for number, part in enumerate([folder / _BEGIN, *parts, folder / _END]):
        document: dict[str, Any] = read_yaml(part / METADATA, "bag's metadata", RecordingError)[_BAG]
        (file,) = document["files"]
        name = f"{folder.name}_{number:0{digits}}.mcap"
        with failure_named(folder):
            _link(part / file["path"], folder / name)
        documents.append(document | {"files": [file | {"path": name}]})
    for end in (_BEGIN, _END):
        shutil.rmtree(folder / end)
    (folder / METADATA).write_text(yaml.safe_dump({_BAG: _joined(documents)}, sort_keys=True))


def _link(source: Path, target: Path) -> None:
    """The same file in another folder; a copy where the file systems differ."""
    with suppress(OSError):
        return os.link(source, target)
    shutil.copyfile(source, target)


def _joined(documents: Sequence[dict[str, Any]]) -> dict[str, Any]:
    """The metadata of a bag of several files, by that of each."""
    topics: dict[str, dict[str, Any]] = {}
    for document in documents:
        for topic in document["topics_with_message_count"]:
            name = topic["topic_metadata"]["name"]
            before = topics[name]["message_count"] if name in topics else 0
            topics[name] = topic | {"message_count": before + topic["message_count"]}
    files = [file for document in documents for file in document["files"]]
    begins = [file["starting_time"]["nanoseconds_since_epoch"] for file in files if file["message_count"]]
    ends = [
        file["starting_time"]["nanoseconds_since_epoch"] + file["duration"]["nanoseconds"]
        for file in files
        if file["message_count"]
    ]
    return documents[0] | {
        "files": files,
        "relative_file_paths": [file["path"] for file in files],
        "message_count": sum(file["message_count"] for file in files),
        "starting_time": {"nanoseconds_since_epoch": min(begins)},
        "duration": {"nanoseconds": max(ends) - min(begins)},
        "topics_with_message_count": list(topics.values()),
    }
