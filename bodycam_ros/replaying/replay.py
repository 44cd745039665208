"""Offline replay: reads a recorded bag and writes a bag with all topics of docs/roboticists.md."""

import logging
import time
from collections.abc import Callable, Collection, Iterator
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
from bodycam_ros.registration.reference_map import ASSUMED_VERTICAL, load_map
from bodycam_ros.replaying.camera_worker import RegisteredImage, RegistrationTask, Result, missing_images
from bodycam_ros.replaying.extend import ExtensionRound, extend_map
from bodycam_ros.replaying.front_end import merged_results, start_workers
from bodycam_ros.replaying.recorded_part import part_s, published_window
from bodycam_ros.replaying.replay_output import ReplayOutput
from bodycam_ros.replaying.replay_request import ReplayRequest
from bodycam_ros.replaying.replay_summary import ReplaySummary
from bodycam_ros.replaying.static_input import read_recorded_static_cameras
from bodycam_ros.replaying.worker_process import warm_up
from bodycam_ros.results.provenance import source_remarks, write_sources
from bodycam_ros.static_cameras.start_file import AUTO

logger = logging.getLogger(__name__)


def replay(request: ReplayRequest, on_step: Callable[[str, float], None] = lambda step, share: None) -> ReplaySummary:
    """Run the pipeline over a bag and write everything that it publishes.

    Args:
        request: the files, and how they are solved.
        on_step: called with each step, and the share of it that is done.

    Raises:
        BodycamError: anything that is wrong with the input, see the stages.
    """
    warm_up()
    started = time.monotonic()
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
        sensor_paths = (request.recording, *request.imus) if recording.has_sensors or request.imus else ()
        imus = read_imus(sensor_paths, mounted, request.names) if settings.inertial.enabled and mounted else {}
        for remark in unused_sensors(body, imus):
            logger.warning("%s", remark)
        # Cameras are registered while the rest is made ready.
        task = RegistrationTask(
            request.recording,
            map_path or Path(),
            settings,
            readouts=body.readout_starts,
            slim=request.slim,
            turns=camera_turns(body, imus),
            names=request.names,
            window_ns=window_ns,
        )
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
                people = detect_start(recording.images(stations, window_ns), stations, on_people)
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
            on_corrected=log.add_registration,
            equipment=coupling,
            on_together=partial(on_step, "all frames together"),
            static_cameras=static_cameras,
            stations=stations,
            imus=imus,
        )
        # The states of the body, as soon as they are solved.
        writer = stack.enter_context(write_recording(request.output, request.force))
        sources = request.sources(own, reference_map, recording.start_ns, recording.first_stamp_ns)
        write_sources(writer, sources, own, recording.start_ns)
        summary.notes = (*([f"{left_out}; --all solves these parts too"] if left_out else ()), *source_remarks(sources))
        summary.recorded_s = part_s(window_ns, recording)
        out = ReplayOutput(writer, skeleton, log, cameras, stations, reference_map, coupling, summary)
        registered: Iterator[Result] = iter(())
        if reference_map is not None and cameras:
            registered = merged_results(workers, settings.extension, reference_map)
        images_step = f"replay of {summary.recorded_s:.1f} s"
        for item in _with_images(registered, recording, stations, window_ns):
            out.write_image(item)
            if isinstance(item, (RegisteredImage, CameraImage)):
                out.write_states(skeleton.add(item.matches if isinstance(item, RegisteredImage) else item))
                on_step(images_step, 1e-9 * (item.stamp_ns - summary.start_ns) / max(summary.recorded_s, 1e-9))
        out.write_states(skeleton.flush())
        if not summary.solved:
            raise _nothing_solved(request, out.unusable)
        # Hands that the body file does not have were added here, and need not be observed.
        out.finish(own.segments_without(cameras))
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


def _with_images(
    registered: Iterator[Result], recording: Recording, stations: Collection[str], window_ns: tuple[int, int]
) -> Iterator[Result | CameraImage]:
    """Registrations of body cameras, and images of static ones, in order of their stamps; then missing ones."""
    images = recording.images(stations, window_ns) if stations else ()
    yield from merge(registered, images, key=lambda item: item.stamp_ns)
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
