"""The package as a library: a loop over images, and states as they are solved.

from bodycam_ros import Body, Map, replay

states = replay("walk.mcap", Map.load("map"), Body.load("body.yaml"))
for output in states:
    print(output.state.stamp_ns, dict(zip(output.joint_names, output.positions)))
print(states.verdict)
"""

from collections import deque
from collections.abc import Iterable, Iterator, Mapping
from contextlib import ExitStack
from dataclasses import fields, replace
from pathlib import Path
from types import NoneType

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.average_person import with_hands
from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.coupled_body import coupled_body
from bodycam_ros.body.equipment import Equipment
from bodycam_ros.body_state import BodyOutput
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera.camera_info import camera_from_yaml
from bodycam_ros.camera.readout import Readout, best_known
from bodycam_ros.errors import BodyError
from bodycam_ros.estimation.solver_counts import SolverCounts
from bodycam_ros.estimation.static_evidence import StaticMeasurement
from bodycam_ros.formats.static_cameras_file import read_static_cameras
from bodycam_ros.geometry import Array
from bodycam_ros.inertial.imu_samples import ImuSamples
from bodycam_ros.pipeline.camera_front import CameraFront, camera_fronts
from bodycam_ros.pipeline.sensors import camera_turns
from bodycam_ros.pipeline.settings import PipelineSettings
from bodycam_ros.pipeline.skeleton import SkeletonPipeline
from bodycam_ros.pipeline.static_cameras import image_measurement
from bodycam_ros.quality.camera_poses import CameraPoseLog
from bodycam_ros.quality.judge import judge
from bodycam_ros.quality.static_camera_findings import StaticCameraLog
from bodycam_ros.quality.unsolved_findings import unsolved_findings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.recording.imu_reader import read_imus
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.replaying.extend import extend_map
from bodycam_ros.replaying.map_updates import MapReplica, MapUpdate, MapUpdateSource
from bodycam_ros.replaying.recorded_part import WHOLE, published_window
from bodycam_ros.replaying.static_input import read_recorded_static_cameras
from bodycam_ros.results.verdict import Verdict
from bodycam_ros.static_cameras.detected_people import detect_start
from bodycam_ros.static_cameras.start_file import AUTO, StaticCameraFiles
from bodycam_ros.static_cameras.static_camera import StaticCamera
from bodycam_ros.static_cameras.static_measurement import ImageMeasurement
from bodycam_ros.tracking.image_rate import ImageRateLimit

__all__ = ["Body", "CameraImage", "CameraModel", "Map", "Replay", "StaticCameraFiles", "extend_map", "replay"]


class Body(BodyModel):
    """Segments, joints and camera mounts: ``Body.load("body.yaml")``."""

    @classmethod
    def load(cls, path: Path | str) -> "Body":
        """Read a body file: URDF if it is named so, else YAML.

        Raises:
            BodyError: the file is missing, or describes no body.
        """
        body = read_body(path)
        if body.surface is not None:
            body = replace(body, surface=str(Path(path).resolve().parent / body.surface))
        return cls(**{field.name: getattr(body, field.name) for field in fields(body) if field.init})


Map = ReferenceMap


class Replay(Iterator[BodyOutput]):
    """The states of a recording as they are solved, in order of time, and whether they may be used; see ``replay``.

    Attributes:
        left_out: which part of a bag is not solved, and why; empty for none, and before the first state.
    """

    def __init__(
        self,
        images: Path | str | Iterable[CameraImage],
        reference_map: Map | None,
        body: BodyModel,
        cameras: Mapping[str, CameraModel],
        equipment: Equipment | None,
        settings: PipelineSettings,
        live: bool,
        imus: Mapping[str, ImuSamples],
        static_cameras: StaticCameraFiles | None,
        whole: bool,
    ) -> None:
        self._images = images
        self._map = reference_map
        self._own = body
        self._body = with_hands(body) if static_cameras else body
        self._cameras = dict(cameras)
        self._equipment = equipment
        self._settings = settings
        self._live = live
        self._imus, self._static_cameras = dict(imus), static_cameras
        self._whole = whole
        self.left_out = ""
        self._readouts: Mapping[str, Readout | None] = body.readout_starts
        self._stations: Mapping[str, StaticCamera] = {}
        self._stamps_ns: Mapping[str, NDArray[np.int64]] | None = None  # of all images of static cameras of a bag
        self._people: dict[str, list[list[Array]]] | None = None  # in the first images, where the start is detected
        self._log = CameraPoseLog(coupled_body(self._body, equipment), self._cameras, settings.pose_fit.inlier_px)
        self._static_log = StaticCameraLog()
        self._skeleton: SkeletonPipeline | None = None
        self._solved = 0
        self._states = self._solve()

    def __next__(self) -> BodyOutput:
        """The next state."""
        return next(self._states)

    @property
    def verdict(self) -> Verdict:
        """Verdict on the states that were taken so far, as ``bodycam replay`` prints it; equipment is not judged."""
        bare: list[str] = []
        if self._static_cameras is not None:
            bare = self._own.segments_without(self._cameras)
        counts = SolverCounts() if self._skeleton is None else self._skeleton.counts
        unsolved = unsolved_findings(self._solved, counts.contradictory, counts.rejected)
        return judge(self._log.poses(), (*self._static_log.findings(bare), *unsolved))

    def _solve(self) -> Iterator[BodyOutput]:
        with ExitStack() as opened:
            images = self._open(opened)
            if not (set(self._cameras) & set(self._body.mounts) or self._stations):
                raise BodyError(f"none of the cameras that have models is on the body ({', '.join(self._body.mounts)})")
            skeleton = self._skeleton = SkeletonPipeline(
                self._body,
                self._cameras,
                self._settings,
                self._live,
                on_corrected=self._log.add_registration,
                equipment=self._equipment,
                static_cameras=self._measurement(),
                stations=self._stations,
                imus=self._imus,
            )
            for message in self._messages(images):
                yield from self._logged(skeleton.add(message))
            yield from self._logged(skeleton.flush())

    def _open(self, opened: ExitStack) -> Iterable[CameraImage]:
        """The images, once cameras, sensors and stations are those of the recording."""
        given, files, body = self._images, self._static_cameras, self._body
        if not isinstance(given, Path | str):
            if files is not None:
                self._stations = read_static_cameras(files.stations, self._map)
            return given
        recording = opened.enter_context(open_recording(Path(given)))
        body_cameras = (
            [camera for camera in recording.cameras if camera in body.mounts] if self._map is not None else []
        )
        if files is not None:
            self._stations = read_recorded_static_cameras(files, self._map, recording, body)
            if files.evidence not in (None, AUTO):
                self._stamps_ns = recording.image_stamps(self._stations)
        if not self._cameras:
            self._cameras.update({camera: recording.camera_model(camera) for camera in body_cameras})
        self._readouts = {
            camera: best_known(recording.readout(camera), self._readouts.get(camera)) for camera in body_cameras
        }
        self._imus = self._imus or read_imus([Path(given)], body_cameras)
        # Static cameras observe what body cameras that are not on yet do not.
        solves_all = self._whole or bool(self._stations)
        window_ns, self.left_out = published_window(recording, body_cameras or recording.cameras, WHOLE, solves_all)
        if files is not None and files.start == AUTO:
            self._people = detect_start(recording.images(self._stations, window_ns), self._stations)
        return recording.images([*body_cameras, *self._stations], window_ns)

    def _measurement(self) -> ImageMeasurement | None:
        """What measures the body by static cameras, if there are any."""
        if self._static_cameras is None:
            return None
        body = coupled_body(self._body, self._equipment)

        def log(stamps_ns: Mapping[str, int], measured: StaticMeasurement) -> None:
            self._static_log.add_measured(stamps_ns, measured, body.segments)

        return image_measurement(
            self._static_cameras,
            self._stations,
            body,
            Path(),
            self._settings,
            log,
            live=self._live,
            stamps_ns=self._stamps_ns,
            people=self._people,
        )

    def _messages(self, images: Iterable[CameraImage]) -> Iterator[LandmarkMatches | CameraImage]:
        """Registrations of body cameras, which may extend the map, and images of static ones."""
        settings, reference_map = self._settings, self._map
        fronts: Mapping[str, CameraFront] = {}
        source = replica = None
        if reference_map is not None:
            if settings.extension.enabled:
                sent: deque[MapUpdate] = deque()
                source = MapUpdateSource(reference_map, settings.extension.capacity, sent.append)
                replica = MapReplica(reference_map, settings.extension.capacity, sent.popleft)
            fronts = camera_fronts(
                {camera: model for camera, model in self._cameras.items() if camera in self._body.mounts},
                reference_map,
                settings,
                readouts=self._readouts,
                turns=camera_turns(self._body, self._imus) if settings.inertial.enabled else {},
                registered_in=None if replica is None else replica.map,
            )
        limit = ImageRateLimit(settings.images.max_rate)
        for image in images:
            _check_kind("one of the images", image, (CameraImage,), "CameraImage(camera, stamp_ns, pixels)")
            if image.camera in self._stations:
                yield image
            if image.camera not in fronts or not limit.is_due(image.camera, image.stamp_ns):
                continue
            if source is not None and replica is not None:
                source.advance(image.recorded_ns or image.stamp_ns)
                replica.advance(image.recorded_ns or image.stamp_ns)
            _, matches, keyframe = fronts[image.camera].process(decode_grey(image), image.stamp_ns)
            if source is not None and keyframe is not None:
                source.mapper.wait_for_turn(keyframe)
            yield matches

    def _logged(self, outputs: Iterable[BodyOutput]) -> Iterator[BodyOutput]:
        for output in outputs:
            self._solved += 1
            self._log.add_state(output.state.stamp_ns, output.state.world_T_segment)
            yield output


def replay(
    images: Path | str | Iterable[CameraImage],
    reference_map: Map | None,
    body: BodyModel,
    cameras: Mapping[str, CameraModel | Path | str] | None = None,
    equipment: Equipment | None = None,
    settings: PipelineSettings | None = None,
    live: bool = False,
    imus: Mapping[str, ImuSamples] | None = None,
    static_cameras: StaticCameraFiles | None = None,
    whole: bool = False,
) -> Replay:
    """Solve a recording in this process: an iterator over states, and their verdict.

    States follow their images by some seconds, in which later images give the clocks and the poses of limbs that were
    blind. More passes over a recording are a replay in the map that it extended: ``extend_map``.

    Args:
        images: a ros2 bag folder or .mcap file, or images in order of their stamps.
        reference_map: metric; None with static cameras alone.
        body: which has been calibrated.
        cameras: name -> model of a body camera, or its camera_info YAML as ROS writes it; of a bag its own.
        equipment: what the body rides, holds or stands on.
        settings: of all stages.
        live: states follow by ``estimator.output_delay`` frames alone, and may be as much less accurate.
        imus: camera -> samples of its inertial sensor; of a bag its own.
        static_cameras: files of cameras that stand around the body, if there are any.
        whole: solve all of a bag, also where few of the body's cameras run.

    Raises:
        RecordingError: there is no recording, or an image cannot be decoded; with the first state.
        BodyError: the body carries none of the cameras that have models; with the first state.
        StaticCameraError: the static cameras cannot be used; with the first state.
        LensError: a camera_info YAML cannot be used.
        TypeError: an argument is of another kind, such as the path of a map in place of the map.
    """
    _check_kind("reference_map", reference_map, (Map, NoneType), 'Map.load("map")')
    _check_kind("body", body, (BodyModel,), 'Body.load("body.yaml")')
    _check_kind("images", images, (Path, str, Iterable), 'a bag, "walk.mcap", or CameraImage(camera, stamp_ns, pixels)')
    _check_kind("cameras", cameras, (Mapping, NoneType), '{"head": "head.yaml"}')
    _check_kind("settings", settings, (PipelineSettings, NoneType), "PipelineSettings()")
    return Replay(
        images,
        reference_map,
        body,
        {camera: _lens(camera, lens) for camera, lens in (cameras or {}).items()},
        equipment,
        settings or PipelineSettings(),
        live,
        imus or {},
        static_cameras,
        whole,
    )


def _lens(camera: str, lens: CameraModel | Path | str) -> CameraModel:
    """Model of a camera, which may be in a file."""
    _check_kind(f"cameras[{camera!r}]", lens, (CameraModel, Path, str), '"head.yaml", or a CameraModel')
    return lens if isinstance(lens, CameraModel) else camera_from_yaml(Path(lens), camera)


def _check_kind(argument: str, given: object, kinds: tuple[type, ...], expected: str) -> None:
    if not isinstance(given, kinds):
        raise TypeError(f"replay: {argument} is a {type(given).__name__}; expected {expected}")
