"""All checks of a recording, in the order in which a person should see to them."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bodycam_ros.body.body_file import read_body
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.geometry import Array
from bodycam_ros.kernels import prepare_kernels
from bodycam_ros.mapping.board import read_board
from bodycam_ros.mapping.photographs import BOARD_FILE
from bodycam_ros.mapping.progress import Progress
from bodycam_ros.quality.camera_checks import check_cameras, check_clocks, check_field_of_view, check_lens, check_rates
from bodycam_ros.quality.doctor_settings import DoctorGroups
from bodycam_ros.quality.finding import Finding
from bodycam_ros.quality.image_checks import check_blur, check_exposure, check_features
from bodycam_ros.quality.place_checks import OPENING_S, check_board, check_exercise, check_registration, check_rest
from bodycam_ros.quality.sampled_recording import (
    SampledRecording,
    register_samples,
    sample_bag,
    sample_videos,
    spread_instants,
)
from bodycam_ros.recording.video_file import SUFFIXES as VIDEO_SUFFIXES
from bodycam_ros.registration.reference_map import ReferenceMap

_BAG_SUFFIXES, _BAG_FILE = {".mcap", ".db3"}, "metadata.yaml"


@dataclass(frozen=True)
class DoctorInput:
    """What the doctor is given.

    Attributes:
        recording: ros2 bag folder or file, a video, or a folder with videos.
        map: folder of the reference map; None: nobody can tell what registers.
        body: body file, whose cameras should be there.
        rig: rig file of a range of motion, whose joints should be exercised.
        board: description of the AprilTag board; None: board.yaml beside the recording, if it is there.
        lenses: folder with the lens YAMLs of videos; None: beside them.
    """

    recording: Path
    map: Path | None = None
    body: Path | None = None
    rig: Path | None = None
    board: Path | None = None
    lenses: Path | None = None


def examine(given: DoctorInput, settings: DoctorGroups, jobs: int, progress: Progress) -> list[Finding]:
    """Make all checks that there is something for.

    Raises:
        BodycamError: recording, map, body, rig or board cannot be read.
    """
    reference_map = None if given.map is None else ReferenceMap.load(given.map)
    rig = None if given.rig is None else Rig.from_yaml(given.rig)
    mounts = None if given.body is None else tuple(read_body(given.body).mounts)
    wanted = mounts if rig is None else tuple(rig.cameras)
    board_path = given.board or given.recording.resolve().parent / BOARD_FILE
    board = read_board(board_path) if given.board is not None or board_path.is_file() else None
    is_exercise = rig is not None and reference_map is not None and is_bag(given.recording)
    count = max(settings.doctor.images, settings.doctor.exercise_images) if is_exercise else settings.doctor.images

    def instants(duration_s: float) -> Array:
        opening = [second for second in OPENING_S if is_exercise and second < duration_s]
        return np.sort(np.concatenate([opening, spread_instants(duration_s, count)]))

    with progress.step("reading", count + is_exercise * len(OPENING_S)) as advance:
        if is_bag(given.recording):
            recording = sample_bag(given.recording, instants, advance)
        else:
            recording = sample_videos(given.recording, given.lenses, instants, advance)
    findings = [
        *check_cameras(recording, wanted),
        *check_rates(recording, settings.doctor),
        *check_clocks(recording, settings.doctor),
        *check_lens(recording),
        *check_exposure(recording, settings.doctor),
        *check_blur(recording, settings.doctor),
        *check_features(recording, settings.doctor),
    ]
    if board is not None:
        findings += check_board(recording, board, reference_map is not None)
    if reference_map is not None:
        chosen = (
            range(len(recording.instants_s)) if is_exercise else _some(recording, settings.doctor.registered_images)
        )
        names = wanted or tuple(camera.name for camera in recording.cameras)
        prepare_kernels()
        with progress.step("registering", len(chosen)) as advance:
            registered = register_samples(
                recording, names, _spread_first(chosen), reference_map, settings, jobs, advance
            )
        findings += check_registration(registered, settings.doctor)
        if is_bag(given.recording):
            findings += check_field_of_view(given.recording, registered, settings.doctor, progress)
        if is_exercise and rig is not None:
            findings += check_rest(registered, rig.cameras)
            findings += check_exercise(registered, rig, settings.doctor)
    return findings


def is_bag(recording: Path) -> bool:
    """Whether a path is a ros2 bag, and neither a video nor a folder of videos."""
    suffix = recording.suffix.lower()
    has_videos = suffix in VIDEO_SUFFIXES or recording.is_dir()
    return suffix in _BAG_SUFFIXES or (recording / _BAG_FILE).is_file() or not has_videos


def _some(recording: SampledRecording, count: int) -> list[int]:
    last = len(recording.instants_s) - 1
    return sorted(set(np.linspace(0, last, min(count, last + 1)).round().astype(int).tolist()))


def _spread_first(instants: Sequence[int]) -> list[int]:
    """The middle first, then those beside it: what begins with a dark pocket is not hopeless."""
    middle = instants[len(instants) // 2]
    return sorted(instants, key=lambda number: abs(number - middle))


def notes(given: DoctorInput) -> Iterator[str]:
    """What was not looked at, for want of something that could be given."""
    if given.map is None:
        yield "give --map to see how many images find themselves"
    if given.rig is None and given.body is None:
        yield "give --rig (a range of motion) or --body to see which cameras lack"
    if given.rig is not None and not is_bag(given.recording):
        yield "videos have no common time yet: 'bodycam ingest' first, then the exercise of joints can be seen"
