"""A recording of static cameras in, a body with its lengths and girths out, offline."""

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path

from threadpoolctl import threadpool_limits

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.body_shape import ShapeSettings
from bodycam_ros.body_state import BodyFrame
from bodycam_ros.calibration.body_calibrator import BodyCalibrator, CalibratedBody
from bodycam_ros.calibration.rig import Rig
from bodycam_ros.errors import RangeOfMotionError, StaticCameraError
from bodycam_ros.files.merged_lines import merge_lines
from bodycam_ros.formats.read_captured import read_start
from bodycam_ros.inertial.imu_calibrator import RegisteredSensors
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.imu_reader import read_imus
from bodycam_ros.recording.time_span import TimeSpan
from bodycam_ros.recording.topic_names import AS_RECORDED, TopicNames
from bodycam_ros.registration.reference_map import load_map
from bodycam_ros.replaying.camera_worker import RegistrationTask
from bodycam_ros.replaying.front_end import registered_images
from bodycam_ros.replaying.recorded_part import WHOLE, window_with_images
from bodycam_ros.replaying.static_input import read_recorded_static_cameras
from bodycam_ros.replaying.worker_process import warm_up
from bodycam_ros.results.provenance import MAP, map_record
from bodycam_ros.static_cameras.body_measurement import BodyMeasurement, MeasuredBody
from bodycam_ros.static_cameras.detected_people import detect_start
from bodycam_ros.static_cameras.start_file import AUTO, StaticCameraFiles
from bodycam_ros.timing.arrivals import frames_at_once
from bodycam_ros.tracking.image_rate import ImageSettings

_MAX_RATE_HZ = 25.0  # images used of a body camera; more take longer, at 12 a walk is 10 to 16 % less accurate


def measure_body(
    recording_path: Path,
    map_path: Path | None,
    body: BodyModel,
    given: StaticCameraFiles,
    pipeline: PipelineSettings,
    settings: ShapeSettings,
    on_progress: Callable[[str, float], None] = lambda step, share: None,
    names: TopicNames = AS_RECORDED,
) -> MeasuredBody:
    """Measure the person of a recording.

    Args:
        recording_path: ros2 bag folder or .mcap file.
        map_path: folder of the reference map; None where the stations' own frame is the world.
        body: initial estimate; it gets hands, and loses its scan, which has lengths of its own.
        given: where the stations stand, and where the body is in the first images.
        pipeline: settings of following it.
        settings: what is expected of it.
        on_progress: called with the step, and the share of it that is done.
        names: of the recording's topics.

    Raises:
        BodycamError: anything that is wrong with the input, or a recording that does not determine the body.
    """
    warm_up()
    start = given.start
    if start is None:
        raise StaticCameraError(
            f"the initial pose of the body is unknown; give --start auto, or set it by hand with 'bodycam view --place "
            f"{recording_path}', and give the file that it writes with --start"
        )
    body = replace(with_hands(body), surface=None)
    reference_map = None if map_path is None else load_map(map_path)
    with open_recording(recording_path, names) as recording:
        stations = read_recorded_static_cameras(given, reference_map, recording, body)
        people = None
        if start == AUTO:
            people = detect_start(recording.images(stations), stations, partial(on_progress, "people in first images"))
        measurement = BodyMeasurement(
            body,
            stations,
            lambda: _frames(recording_path, stations, names),
            lambda initial: read_start(start, given.stations, stations, initial, given.person, people),
            settings,
            pipeline.region,
            pipeline.motion,
            on_progress,
        )
        # The matrices are many and small: threads of the linear algebra would only wait for each other.
        with threadpool_limits(limits=1):
            try:
                return measurement.measure()
            except RangeOfMotionError as error:
                raise RangeOfMotionError(f"{recording_path}: {error}") from error


def _frames(path: Path, stations: Collection[str], names: TopicNames) -> Iterator[tuple[float, BodyFrame]]:
    """Images of static cameras that are of one time, in order of time, and the share of the recording before them."""
    with open_recording(path, names) as recording:
        start_ns, length_ns = recording.first_stamp_ns, max(1e9 * recording.duration_s, 1.0)
        for frame in frames_at_once(recording.images(stations), stations):
            yield (frame.stamp_ns - start_ns) / length_ns, frame


def calibrate(
    recording_path: Path,
    map_path: Path,
    rig: Rig,
    name: str,
    pipeline: PipelineSettings,
    jobs: int,
    facing_rad: float | None = None,
    on_progress: Callable[[str, float], None] = lambda step, share: None,
    imu_paths: Sequence[Path] = (),
    names: TopicNames = AS_RECORDED,
    rest_s: tuple[float, float] | None = None,
    span: TimeSpan = WHOLE,
) -> CalibratedBody:
    """Estimate the body of a recorded range of motion.

    Args:
        recording_path: ros2 bag folder or .mcap file.
        map_path: folder of the reference map.
        rig: which camera is on which segment.
        name: of the body.
        pipeline: settings of tracking and registration, and the noise that the solver assumes.
        jobs: processes for the cameras.
        facing_rad: which way the person faces in the N-pose [rad]; None to read it off hips and shoulders.
        on_progress: called with the step, and the share of it that is done.
        imu_paths: bags with the cameras' inertial sensors, beside those in the recording itself.
        names: of the recording's topics.
        rest_s: (from, to) when the N-pose is held, in the recording's time [s]; None to search for it.
        span: the part of the recording that is used.

    Raises:
        BodycamError: anything that is wrong with the input, or a motion that does not determine the body.
    """
    warm_up()
    report = {MAP: map_record(load_map(map_path, upright=True), map_path)}
    with open_recording(recording_path, names) as recording:
        if missing := merge_lines(rig.missing_cameras(recording.cameras)):
            raise RangeOfMotionError(
                f"{recording_path}: {'; '.join(missing)}. The recording has {', '.join(recording.cameras)}"
            )
        models = {camera: recording.camera_model(camera) for camera in rig.cameras}
        first_ns = recording.first_stamp_ns
        window_ns = window_with_images(recording, rig.cameras, span)
    calibrator = BodyCalibrator(
        rig,
        models,
        pipeline.pose_fit,
        pipeline.evidence,
        facing_rad,
        pipeline.clock,
        rest_s,
        first_ns,
    )
    images = ImageSettings(min(pipeline.images.max_rate or _MAX_RATE_HZ, _MAX_RATE_HZ))
    task = RegistrationTask(
        recording_path,
        map_path,
        replace(pipeline, images=images),
        with_messages=False,
        windows_ns=(window_ns,),
        names=names,
    )
    sensors = RegisteredSensors(read_imus((recording_path, *imu_paths), models, names))
    for image in registered_images(task, models, jobs, partial(on_progress, "registration")):
        calibrator.add(image.matches)
        sensors.add(image.camera, image.stamp_ns, image.matches.world_T_camera)
    # The matrices are many and small: threads of the linear algebra would only wait for each other.
    with threadpool_limits(limits=1):
        calibrated = calibrator.solve(name, on_progress)
        imus = sensors.calibrate()
    body = calibrated.body
    mounts = {camera: replace(mount, imu=imus.get(camera)) for camera, mount in body.mounts.items()}
    return replace(calibrated, body=replace(body, mounts=mounts, report=report))
