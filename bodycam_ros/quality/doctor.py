"""All checks of a recording, in the order in which a person should act on them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bodycam_ros.boards.board import read_board
from bodycam_ros.body.body_file import read_body
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RecordingError
from bodycam_ros.geometry import Array
from bodycam_ros.mapping.photographs import BOARD_FILE
from bodycam_ros.progress import Progress
from bodycam_ros.quality.place_checks import (
    OPENING_S,
    check_board,
    check_exercise,
    check_field_of_view,
    check_registration,
    check_rest,
    check_rig,
)
from bodycam_ros.quality.recording_checks import (
    IMAGE_CHECKS,
    check_cameras,
    check_clocks,
    check_gaps,
    check_lens,
    check_spans,
)
from bodycam_ros.quality.sampled_recording import (
    register_samples,
    sample_bag,
    sample_videos,
    sampled_part,
    spread_times,
)
from bodycam_ros.quality.sensor_checks import check_sensors
from bodycam_ros.quality.video_checks import check_videos
from bodycam_ros.recording.bag_file import is_bag
from bodycam_ros.recording.imu_reader import read_imus
from bodycam_ros.recording.time_span import TimeSpan
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames
from bodycam_ros.recording.video_file import SUFFIXES as VIDEO_SUFFIXES
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.results.verdict import Finding, check_limits

_IMAGES = 12  # of each camera, spread over the recording: faults that last are found in seconds
_REGISTERED_IMAGES = 6  # of those, for the share that registers: each costs a tenth of a second
_EXERCISE_IMAGES = 20  # of each camera of a range of motion; more miss fewer turns


@dataclass(frozen=True)
class DoctorInput:
    """Input of the doctor.

    Attributes:
        recording: ros2 bag folder or file, a video, or a folder with videos or images, or with one for each camera.
        map: folder of the reference map; None: registration is not checked.
        body: body file, whose cameras are expected.
        rig: rig file of a range of motion, whose joints are to be exercised.
        board: description of the AprilTag board; None: board.yaml beside the recording, if it is there.
        lenses: folder with the lens YAMLs of videos; None: beside them.
        rate: of images that are not named by their stamps [Hz].
        imu: bags with the inertial sensors, beside those in the recording.
        names: of the topics of a bag.
        span: the part of the recording that is checked.
    """

    recording: Path
    map: Path | None = None
    body: Path | None = None
    rig: Path | None = None
    board: Path | None = None
    lenses: Path | None = None
    rate: float | None = None
    imu: Sequence[Path] = ()
    names: TopicNames = AS_RECORDED
    span: TimeSpan = TimeSpan()

    @property
    def is_bag(self) -> bool:
        """Whether the recording is a ros2 bag, and neither a video nor a folder of videos."""
        has_videos = self.recording.suffix.lower() in VIDEO_SUFFIXES or self.recording.is_dir()
        return is_bag(self.recording) or not has_videos


def examine(given: DoctorInput, jobs: int, progress: Progress) -> list[Finding]:
    """Make all checks that the input allows.

    Raises:
        BodycamError: recording, map, body, rig or board cannot be read, or something is given that the recording has no
            use for.
    """
    _check_given(given)
    reference_map = None if given.map is None else ReferenceMap.load(given.map)
    rig = None if given.rig is None else Rig.from_yaml(given.rig)
    mounts = None if given.body is None else tuple(read_body(given.body).mounts)
    wanted = mounts if rig is None else tuple(rig.cameras)
    board_path = given.board or given.recording.resolve().parent / BOARD_FILE
    board = read_board(board_path) if given.board is not None or board_path.is_file() else None
    is_exercise = rig is not None and reference_map is not None and given.is_bag
    count = _EXERCISE_IMAGES if is_exercise else _IMAGES

    def sample_times(duration_s: float) -> Array:
        opening = [second for second in OPENING_S if is_exercise and second < duration_s]
        length_s = max(min(given.span.to_s, duration_s) - given.span.from_s, 0.0)
        return given.span.from_s + np.sort(np.concatenate([opening, spread_times(length_s, count)]))

    with progress.step("reading", count + is_exercise * len(OPENING_S)) as advance:
        if given.is_bag:
            recording = sample_bag(given.recording, sample_times, advance, given.names)
        else:
            recording = sample_videos(given.recording, given.lenses, sample_times, advance, given.rate)
    recording = sampled_part(recording, given.span)
    is_exercise = is_exercise and recording.is_simultaneous
    findings = [
        *check_cameras(recording, wanted),
        *check_gaps(recording),
        *check_spans(recording),
        *check_clocks(recording),
        *check_videos(recording.videos, rig, progress),
        *check_lens(recording),
        *check_limits({camera.name: camera for camera in recording.cameras}, IMAGE_CHECKS),
    ]
    bags = (*([given.recording] if given.is_bag else []), *given.imu)
    findings += check_sensors(read_imus(bags, [camera.name for camera in recording.cameras], given.names))
    if board is not None:
        findings += check_board(recording, board, reference_map is not None)
    if reference_map is not None:
        last = len(recording.times_s) - 1
        chosen = np.arange(last + 1)
        if recording.is_simultaneous and not is_exercise:
            chosen = np.unique(np.linspace(0, last, min(_REGISTERED_IMAGES, last + 1)).round().astype(int))
        # The middle first: a recording that begins in a dark pocket is not hopeless.
        order = chosen[np.argsort(np.abs(chosen - chosen[len(chosen) // 2]), kind="stable")].tolist()
        names = wanted or tuple(camera.name for camera in recording.cameras)
        with progress.step("registering", len(order)) as advance:
            registered = register_samples(recording, names, order, reference_map, jobs, advance)
        findings += check_registration(registered)
        if given.is_bag:
            findings += check_field_of_view(given.recording, registered, progress, given.names)
        if is_exercise and rig is not None:
            findings += check_rest(registered, rig.cameras)
            findings += check_exercise(registered, rig)
            findings += check_rig(registered, rig)
    return findings


def _check_given(given: DoctorInput) -> None:
    """Refuse what would change nothing."""
    if given.is_bag and (given.lenses is not None or given.rate is not None):
        raise RecordingError(
            "--lenses and --rate are for videos and images; a bag has its lenses and times: remove them"
        )
    if not given.is_bag and given.names != AS_RECORDED:
        raise RecordingError("--prefix and --topics are for bags; videos have the names of their files: remove them")


def is_judged_by(findings: Sequence[Finding], check: str) -> bool:
    """Whether a check was made."""
    return any(finding.check == check for finding in findings)


def skipped_checks(given: DoctorInput, findings: Sequence[Finding]) -> Iterator[str]:
    """Checks that were not made, and the input that they need."""
    if given.map is None:
        yield "share of registered images (needs --map)"
    if given.rig is None and given.body is None:
        yield "missing cameras (needs --rig for a range of motion, else --body)"
    if given.rig is not None and not given.is_bag:
        yield "exercise of joints, exchanged cameras: videos have no common time yet, run 'bodycam ingest' first"
    elif given.rig is not None and given.map is not None and not is_judged_by(findings, "exercise"):
        yield "N-pose, exercise of joints, exchanged cameras; 'bodycam body' checks them with all images of the videos"
