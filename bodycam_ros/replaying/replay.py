"""Offline replay: reads a recorded bag and writes a bag with all topics of docs/roboticists.md."""

import logging
import time
from collections.abc import Callable, Collection, Iterable, Iterator
from contextlib import ExitStack
from dataclasses import replace
from functools import cache, partial
from heapq import merge
from pathlib import Path
from tempfile import gettempdir

from threadpoolctl import threadpool_limits

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body, held_equipment
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.camera.camera_image import CameraImage
from bodycam_ros.errors import BodycamError, BodyError, MapError, RecordingError, StaticCameraError
from bodycam_ros.files.whole_file import scratch_folder
from bodycam_ros.pipeline.sensors import camera_turns, unused_sensors
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.pipeline.static_cameras import image_measurement
from bodycam_ros.quality.camera_poses import CameraPoseLog
from bodycam_ros.recording.bag_reader import Recording, open_recording
from bodycam_ros.recording.bag_writer import write_recording
from bodycam_ros.recording.imu_reader import read_imus
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ASSUMED_VERTICAL, load_map
from bodycam_ros.replaying.camera_worker import (
    AwaitedUpdate,
    RegisteredImage,
    RegistrationTask,
    Result,
    missing_images,
    register_images,
)
from bodycam_ros.replaying.extend import ExtensionRound, extend_map
from bodycam_ros.replaying.front_end import Worker, merged_results, start_workers
from bodycam_ros.replaying.recorded_part import published_window
from bodycam_ros.replaying.replay_output import ReplayOutput
from bodycam_ros.replaying.replay_record import SolverOutcome
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.replaying.replay_summary import ReplaySummary
from bodycam_ros.replaying.replay_windows import ReplayWindows
from bodycam_ros.replaying.static_input import read_recorded_static_cameras
from bodycam_ros.replaying.stretch_file import STRETCH_FILE, stretch_bytes
from bodycam_ros.replaying.worker_process import warm_up
from bodycam_ros.results.provenance import PREVIEW, RECORDING, source_remarks, write_sources
from bodycam_ros.static_cameras.start_file import AUTO
from bodycam_ros.timing.clock_estimator import KnownClocks

logger = logging.getLogger(__name__)

_LATE_NS = 300_000_000  # that the images of one camera may be behind another's where a stretch ends


def replay(request: ReplayRequest, on_step: Callable[[str, float], None] = lambda step, share: None) -> ReplaySummary:
    """Run the pipeline over a bag and write everything that it publishes.

    Args:
        request: the files, and how they are solved.
        on_step: called with each step, and the share of it that is done.

    Raises:
        BodycamError: anything that is wrong with the input, see the stages.
    """
    started = time.monotonic()
    first, without = request.first, tuple[str, ...]()
    if first is not None:
        request.check_stretches()
        request = request.in_parts()
    if request.preview:
        request.check_preview()
        without, request = request.left_out_of_parts, request.in_parts()
    if request.stretch is None:
        warm_up()
    settings = request.settings
    outside = request.outside
    with ExitStack() as stack:
        # What was recorded, who wears the cameras, and where they are.
        recording = stack.enter_context(open_recording(request.recording, request.names))
        own = read_body(request.body)
        person = with_hands(own) if outside else own
        coupling = None if request.equipment is None else held_equipment(request.equipment, person)
        body = coupled_body(person, coupling)
        map_path, rounds = request.map, tuple[ExtensionRound, ...]()
        if request.passes > 1 and map_path is not None:
            scratch = stack.enter_context(scratch_folder(Path(gettempdir())))
            map_path, rounds = _extend(request, recording, map_path, body, on_step, scratch)
        clock_sigma_s = max(map(recording.clock_sigma, recording.cameras))
        summary = ReplaySummary(recording.duration_s, rounds=rounds, clock_sigma_s=clock_sigma_s)
        metric_map = cache(lambda: None if map_path is None else load_map(map_path))
        stations = read_recorded_static_cameras(outside, metric_map(), recording, body) if outside else {}
        mounted = _mounted_cameras(recording, body, stations) if map_path else []
        # Static cameras observe what body cameras that are not on yet do not.
        solves_all = request.whole or bool(stations)
        window_ns, left_out = published_window(recording, mounted or recording.cameras, request.span, solves_all)
        if first is not None:
            first.check_recording(request.recording, recording.first_stamp_ns)
            windows = ReplayWindows.of_stretch(first, request.stretch, recording)
        elif request.preview:
            windows = ReplayWindows.of_preview(window_ns, request.preview, recording, mounted)
        else:
            windows = ReplayWindows.of_all(window_ns, recording)
        summary.recorded_s, summary.preview = windows.solved_s, windows.preview
        sensor_paths = (request.recording, *request.imus) if recording.has_sensors or request.imus else ()
        imus = read_imus(sensor_paths, mounted, request.names) if settings.inertial.enabled and mounted else {}
        for remark in unused_sensors(body, imus):
            logger.warning("%s", remark)
        # Cameras are registered while the rest is made ready.
        task = RegistrationTask(
            request.recording,
            map_path or Path(),
            settings,
            readouts=body.readout_starts if first is None else first.readouts,
            slim=request.slim,
            turns=camera_turns(body, imus),
            names=request.names,
            windows_ns=windows.read,
            recorded_ahead_ns=recording.recorded_ahead_ns if request.preview else None,
            anew_ns=windows.anew,
            shares_readouts=first is not None,
        )
        workers = list[Worker]()
        if request.stretch is None:
            workers = stack.enter_context(start_workers(task, mounted, request.jobs))
        # Matrices of some hundred rows: threads of the linear algebra would compete with each other and the workers.
        stack.enter_context(threadpool_limits(1, user_api="blas"))
        cameras = {camera: recording.camera_model(camera) for camera in mounted}
        reference_map = metric_map()
        if reference_map is not None and not reference_map.gravity_aligned:
            logger.warning("%s: %s", request.map, ASSUMED_VERTICAL)
        static_cameras = None
        if outside is not None:
            people = None
            if outside.start == AUTO:
                from bodycam_ros.static_cameras.detected_people import detect_start

                on_people = partial(on_step, "people in the first images")
                people = detect_start(recording.images(stations, windows.read[0]), stations, on_people)
            static_cameras = image_measurement(
                outside,
                stations,
                body,
                request.body,
                settings,
                lambda *measured: out.write_measured(*measured),
                stamps_ns=recording.image_stamps(stations) if outside.evidence not in (None, AUTO) else None,
                people=people,
            )
            if not cameras and outside.start is None:
                raise _nothing_solved(request, "")
        log = CameraPoseLog(body, cameras, settings.pose_fit.inlier_px, start_ns=recording.first_stamp_ns or None)
        skeleton = SkeletonPipeline(
            person,
            cameras,
            settings,
            on_corrected=partial(_log, log, windows.published),
            equipment=coupling,
            on_together=partial(on_step, "all frames together"),
            static_cameras=static_cameras,
            stations=stations,
            imus=imus,
            known_clocks=None if first is None or first.shared is None else KnownClocks(first.shared, first.clocks),
            known_rotations=None if first is None else first.rotations,
        )
        # The states of the body, as soon as they are solved.
        writer = stack.enter_context(write_recording(request.output, request.force))
        sources = request.sources(own, reference_map, recording.start_ns, recording.first_stamp_ns)
        if summary.preview:
            sources[RECORDING][PREVIEW] = summary.preview
        write_sources(writer, sources, own, recording.start_ns)
        cut = [f"{left_out}; --all solves these parts too"] if left_out else []
        summary.notes = (*cut, *without, *source_remarks(sources))
        # The map is drawn once, at the beginning.
        drawn = None if request.stretch else reference_map
        clocks = skeleton.clocks
        out = ReplayOutput(
            writer, skeleton.body, lambda: clocks.histories, log, cameras, stations, drawn, coupling, summary
        )
        registered: Iterator[Result] = iter(())
        if reference_map is not None and cameras:
            if first is not None and request.stretch is not None:
                alone = replace(task, recorded_ahead_ns=first.recorded_ahead_ns)
                registered = (
                    item for item in register_images(alone, (*cameras,)) if not isinstance(item, AwaitedUpdate)
                )
            else:
                registered = merged_results(workers, settings.extension, reference_map)
        images_step = f"replay of {summary.recorded_s:.1f} s"
        items = _with_images(registered, recording, stations, windows.read[0], counts_missing=request.stretch is None)
        outcome = _solve(
            items,
            skeleton,
            out,
            windows,
            lambda stamp_ns: on_step(images_step, 1e-9 * (stamp_ns - summary.start_ns) / max(windows.ends_s, 1e-9)),
        )
        if request.stretch is not None and first is not None:
            record = out.record(request.stretch, first.count, outcome)
            writer.attach(STRETCH_FILE, "application/x-npz", stretch_bytes(record), record.latest_ns)
        elif not summary.solved:
            raise _nothing_solved(request, out.unusable)
        else:
            # Hands that the body file does not have were added here, and need not be observed.
            out.finish(own.segments_without(cameras), outcome)
    summary.elapsed_s = time.monotonic() - started
    return summary


def _extend(
    request: ReplayRequest,
    recording: Recording,
    map_path: Path,
    body: BodyModel,
    on_step: Callable[[str, float], None],
    scratch: Path,
) -> tuple[Path, tuple[ExtensionRound, ...]]:
    """Extend the map by all passes but the last; folder of the extended map, and the rounds."""
    settings, cameras = request.settings, [camera for camera in recording.cameras if camera in body.mounts]
    limited = replace(settings, extension=replace(settings.extension, rounds=request.passes - 1))
    extended, rounds = extend_map(
        recording.path, map_path, limited, request.jobs, cameras, body.readout_starts, on_step, names=recording.names
    )
    extended.save(scratch / "map")
    return scratch / "map", rounds


def _solve(
    items: Iterable[Result | CameraImage],
    skeleton: SkeletonPipeline,
    out: ReplayOutput,
    windows: ReplayWindows,
    on_image: Callable[[int], None],
) -> SolverOutcome:
    """Solve images in the order in which they were recorded, and write what is in the window that is published.

    Args:
        items: what came of each.
        skeleton: solves them.
        out: takes images and states.
        windows: what of it is published.
        on_image: called with the stamp of each [ns].

    Returns:
        What was counted in the window.
    """
    begin_ns, end_ns = windows.published
    before = within = None
    is_over = False
    left_out = 0

    def write(outputs: Iterable[BodyOutput]) -> None:
        nonlocal left_out
        wanted = [output for output in outputs if _is_in(output.state.stamp_ns, windows.published)]
        published = [output for output in wanted if any(_is_in(output.state.stamp_ns, part) for part in windows.states)]
        left_out += len(wanted) - len(published)
        out.write_states(published)

    for item in items:
        if begin_ns <= item.stamp_ns < end_ns:
            before = before or SolverOutcome.of(skeleton)
            out.write_image(item)
            on_image(item.stamp_ns)
        elif item.stamp_ns >= end_ns:
            within = within or SolverOutcome.of(skeleton)
        if isinstance(item, (RegisteredImage, CameraImage)):
            states = skeleton.add(item.matches if isinstance(item, RegisteredImage) else item)
            write(states)
            is_over = is_over or any(each.state.stamp_ns >= end_ns for each in states)
        if is_over and item.stamp_ns > end_ns + _LATE_NS:
            break
    else:
        write(skeleton.flush())
    whole = within or SolverOutcome.of(skeleton)
    counted = whole if before is None else whole.since(before)
    return replace(counted, frames=counted.frames - left_out)


def _log(log: CameraPoseLog, window_ns: tuple[int, int], matches: LandmarkMatches) -> None:
    if _is_in(matches.stamp_ns, window_ns):
        log.add_registration(matches)


def _is_in(stamp_ns: int, window_ns: tuple[int, int]) -> bool:
    return window_ns[0] <= stamp_ns < window_ns[1]


def _with_images(
    registered: Iterator[Result],
    recording: Recording,
    stations: Collection[str],
    window_ns: tuple[int, int],
    counts_missing: bool,
) -> Iterator[Result | CameraImage]:
    """Registrations of body cameras, and images of static ones, in order of their stamps; then those missing."""
    images = recording.images(stations, window_ns) if stations else ()
    yield from merge(registered, images, key=lambda item: item.stamp_ns)
    if counts_missing:
        yield from missing_images(recording, recording.start_ns)


def _nothing_solved(request: ReplayRequest, unusable: str) -> BodycamError:
    """Why there is no motion to write; ``unusable``: why no image could be used, if none could."""
    recording, outside = request.recording, request.outside
    if unusable:
        return RecordingError(f"{recording}: none of its images could be used: {unusable}")
    if outside is not None and outside.start is None:
        return StaticCameraError(
            f"{recording}: no body camera was registered, so the initial pose of the body is unknown; give --start "
            f"auto, or set it by hand with 'bodycam view --place {recording}', and give the file that it writes with "
            "--start"
        )
    if outside is not None:
        return StaticCameraError(f"{recording}: no image of a static camera could be used, so there is no motion")
    return MapError(
        f"no camera of {recording} could be registered in {request.map}, so there is no motion to write; "
        "check that this is the map of the place, and that the images are neither dark nor blurred"
    )


def _mounted_cameras(recording: Recording, body: BodyModel, stations: Collection[str]) -> list[str]:
    """Cameras that the recording has and the body carries; the user is warned of others that are no static cameras.

    Raises:
        BodyError: there are none, and no stations either.
    """
    if others := sorted(set(recording.cameras) - set(body.mounts) - set(stations)):
        logger.warning(
            "%s: %d of its %d cameras are not on body %s and are not used: %s",
            recording.path, len(others), len(recording.cameras), body.name, ", ".join(others),
        )  # fmt: skip
    mounted = [camera for camera in recording.cameras if camera in body.mounts]
    if mounted and (silent := sorted(set(body.mounts) - set(recording.cameras))):
        logger.warning(
            "body %s carries cameras that %s does not have: %s", body.name, recording.path, ", ".join(silent)
        )
    if not mounted and not stations:
        raise BodyError(
            f"none of the cameras of {recording.path} ({', '.join(recording.cameras)}) is on body {body.name} "
            f"({', '.join(body.mounts)}); give the body of this recording"
        )
    return mounted
