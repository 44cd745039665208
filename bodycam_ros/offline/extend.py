"""Rounds of registration and growth over a recording, forwards and backwards in time (A 4.1)."""

import logging
import time
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from tempfile import gettempdir

import cv2
import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.coupled_body import coupled_body, held_equipment
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.camera_image import CameraImage, decode_grey
from bodycam_ros.camera.readout import Readout
from bodycam_ros.errors import RecordingError
from bodycam_ros.mapping.extended_map import KeptImage, extended_map
from bodycam_ros.mapping.growing_map import growing
from bodycam_ros.mapping.growth_settings import ExtensionRound
from bodycam_ros.mapping.map_growth import MapGrowth
from bodycam_ros.mapping.progress import in_parallel
from bodycam_ros.mapping.registration_record import RegisteredImagePose, RegistrationRecord
from bodycam_ros.mapping.small_photographs import SmallPhotographSettings
from bodycam_ros.mapping.worn_keyframe import WornKeyframe, keyframe_of_features
from bodycam_ros.offline.camera_worker import (
    DroppedImages,
    LostImages,
    RegisteredImage,
    RegistrationTask,
    known_readouts,
    mirrored_ns,
)
from bodycam_ros.offline.front_end import register_recording
from bodycam_ros.offline.replay import replay
from bodycam_ros.offline.replay_summary import ReplaySummary
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.recording.bag_reader import open_recording
from bodycam_ros.registration.matching import match_near_prediction
from bodycam_ros.registration.recent_path import steady_pixels
from bodycam_ros.registration.reference_map import ReferenceMap, check_metric
from bodycam_ros.static_cameras.start_file import OutsideInput
from bodycam_ros.static_cameras.station_watch import with_hands
from bodycam_ros.tracking.feature_tracker import view_mask
from bodycam_ros.tracking.keypoints import KeypointDetector
from bodycam_ros.tracking.track_frame import NO_LANDMARK
from bodycam_ros.whole_file import scratch_folder

logger = logging.getLogger(__name__)


OnProgress = Callable[[str, float], None]
"""What is told of the progress: the step, and its share that is done, 0 to 1."""


class MapExtension:
    """Extends a map by what the cameras of a recording see.

    Args:
        recording_path: the recording.
        map_path: folder of the map.
        settings: of all stages, and of the rounds.
        jobs: processes.
        cameras: that are used; all by default.
        readouts: camera -> how long its rows are read out, where somebody but the recording knows.
        on_progress: told how far it is.

    Attributes:
        rounds: what each brought.
        elapsed_s: time that they took.
    """

    def __init__(
        self,
        recording_path: Path,
        map_path: Path,
        settings: PipelineSettings,
        jobs: int,
        cameras: Sequence[str] | None = None,
        readouts: Mapping[str, Readout] | None = None,
        on_progress: OnProgress = lambda step, share: None,
    ) -> None:
        self._recording_path, self._map_path = recording_path, map_path
        self._map = ReferenceMap.load(map_path)
        check_metric(self._map, map_path)
        self._pipeline, self._settings = settings, settings.extend
        self._jobs, self._readouts, self._on_progress = jobs, readouts or {}, on_progress
        with open_recording(recording_path) as recording:
            names = recording.cameras if cameras is None else cameras
            self._cameras = {name: recording.camera_model(name) for name in names}
            self._start_ns, self._duration_s = recording.start_ns, recording.duration_s
        self.rounds: list[ExtensionRound] = []
        self.elapsed_s = 0.0

    def run(self) -> ReferenceMap:
        """The extended map.

        Raises:
            BodycamError: what is wrong with recording or map.
        """
        started_s = time.monotonic()
        record = RegistrationRecord(self._cameras, self._pipeline.growth, self._pipeline.registrar.min_inliers)
        extended = self._map
        with scratch_folder(Path(gettempdir())) as scratch:
            map_path = self._map_path
            while len(self.rounds) < self._settings.rounds:
                backwards = len(self.rounds) % 2 == 1
                # Absolute and relative registration, by photographs and by what has grown (A 4.1).
                self._register(map_path, record, backwards)
                self._note(record, backwards, extended)
                if self._is_enough():
                    break
                # 2D-2D matches between the images that are registered by now, triangulated (A 4.1).
                extended = self._grow(record)
                map_path = scratch / f"round_{len(self.rounds)}"
                extended.save(map_path)
        self.elapsed_s = time.monotonic() - started_s
        return extended

    def _register(self, map_path: Path, record: RegistrationRecord, backwards: bool) -> None:
        task = RegistrationTask(
            self._recording_path,
            map_path,
            self._pipeline,
            with_messages=False,
            readouts=self._readouts,
            backwards=backwards,
        )
        step = f"round {len(self.rounds) + 1}, {'backwards' if backwards else 'forwards'}"
        first_ns = None
        unusable: Counter[str] = Counter()
        for item in register_recording(task, self._cameras, self._jobs):
            first_ns = item.stamp_ns if first_ns is None else first_ns
            if isinstance(item, RegisteredImage):
                stamp_ns = mirrored_ns(self._start_ns, self._duration_s, item.stamp_ns) if backwards else item.stamp_ns
                record.add(item.matches, stamp_ns, backwards)
            elif isinstance(item, LostImages):
                logger.warning("%s", item)
            else:
                unusable[item.camera] += item.count if isinstance(item, DroppedImages) else 1
            self._on_progress(step, 1e-9 * (item.stamp_ns - first_ns) / max(self._duration_s, 1e-9))

        for camera, count in sorted(unusable.items()):
            logger.warning("camera %s: %d images could not be used", camera, count)

    def _note(self, record: RegistrationRecord, backwards: bool, extended: ReferenceMap) -> None:
        landmarks = extended.grown - self._map.grown
        places = {camera: record.places(camera) for camera in self._cameras}
        shares = {camera: record.share(camera) for camera in self._cameras}
        self.rounds.append(
            ExtensionRound(backwards, shares, record.share_of_all, record.absolute_share, landmarks, places)
        )
        logger.info("round %d: %.1f %% of all images registered", len(self.rounds), 100 * record.share_of_all)

    def _is_enough(self) -> bool:
        """Whether there is nothing left to register, or two rounds, one in each direction, brought nothing."""
        shares = [one.share for one in self.rounds]
        return (shares[-1] == 1.0 and len(shares) > 1) or (
            len(shares) > 2 and shares[-1] - shares[-3] < self._settings.least_gain
        )

    def _grow(self, record: RegistrationRecord) -> ReferenceMap:
        step = f"growth {len(self.rounds)}"
        live = self._settings.growth(self._pipeline.growth)
        growth = MapGrowth(growing(self._map, self._settings.capacity), self._cameras, live)
        chosen = record.keyframes(self._settings)
        total = sum(map(len, chosen.values()))
        images = []
        for number, (keyframe, jpeg) in enumerate(self._keyframes(chosen)):
            growth.add(keyframe)
            images.append(KeptImage(keyframe.camera, keyframe.stamp_ns, keyframe.world_T_camera, jpeg))
            self._on_progress(step, (number + 1) / total)
        growth.take_changes()
        return extended_map(
            self._map, growth.grown_points(), images, self._cameras, self._settings.looks, SmallPhotographSettings()
        )

    def _keyframes(self, chosen: Mapping[str, Sequence[RegisteredImagePose]]) -> Iterator[tuple[WornKeyframe, bytes]]:
        """The images that were chosen, in order of time, with their features, and as pictures."""
        poses = {(camera, pose.stamp_ns): pose for camera, of_camera in chosen.items() for pose in of_camera}
        masks = {
            name: view_mask(camera, self._pipeline.tracker.max_view_angle_deg) for name, camera in self._cameras.items()
        }

        def look(image: CameraImage) -> tuple[WornKeyframe, bytes] | None:
            try:
                grey = decode_grey(image)
            except RecordingError:
                return None
            pose = poses[image.camera, image.stamp_ns]
            keyframe = self._keyframe(self._cameras[image.camera], pose, grey, masks[image.camera])
            done, jpeg = cv2.imencode(".jpg", grey, [cv2.IMWRITE_JPEG_QUALITY, self._settings.quality])
            return (keyframe, bytes(jpeg.tobytes())) if done else None

        with open_recording(self._recording_path) as recording:
            images = (i for i in recording.images(list(self._cameras)) if (i.camera, i.stamp_ns) in poses)
            for looked in in_parallel(look, images, self._jobs):
                if looked is not None:
                    yield looked

    def _keyframe(
        self, camera: CameraModel, pose: RegisteredImagePose, grey: NDArray[np.uint8], mask: NDArray[np.uint8]
    ) -> WornKeyframe:
        found = KeypointDetector(self._settings.keypoints).detect(grey, mask)
        pixels = steady_pixels(camera, found.pixels, pose.turning, pose.readout_time)
        named, landmarks = match_near_prediction(
            self._map,
            camera,
            pose.world_T_camera,
            pixels,
            found.descriptors,
            found.scales,
            self._pipeline.matching.radius_px,
            self._pipeline.matching,
        )
        ids = np.full(len(pixels), NO_LANDMARK, np.uint32)
        ids[named] = self._map.landmark_ids[landmarks]
        return keyframe_of_features(
            camera,
            pose.stamp_ns,
            pose.world_T_camera,
            pose.position_sigma,
            pixels,
            found.descriptors,
            found.scales,
            ids,
        )


def replay_in_passes(
    recording_path: Path,
    map_path: Path | None,
    body_path: Path,
    output_path: Path,
    settings: PipelineSettings,
    jobs: int,
    passes: int = 1,
    force: bool = False,
    on_step: OnProgress = lambda step, share: None,
    on_progress: Callable[[float], None] = lambda seconds: None,
    equipment: str | Path | None = None,
    outside: OutsideInput | None = None,
    slim: bool = False,
) -> tuple[ReplaySummary, Sequence[ExtensionRound]]:
    """As ``replay``, with the map extended by the recording itself before; and what each round of that brought.

    Args:
        recording_path, map_path, body_path, output_path, settings, jobs, force, on_progress, equipment, outside: as of
            ``replay``, and so is slim.
        passes: over the recording, the last one included.
        on_step: called with each step before the last pass or beside it, and the share of it that is done.

    Raises:
        BodycamError: as ``replay``.
    """
    if passes == 1 or map_path is None:
        summary = replay(
            recording_path,
            map_path,
            body_path,
            output_path,
            settings,
            jobs,
            force,
            on_progress,
            equipment,
            on_step,
            outside,
            slim,
        )
        return summary, ()
    person = read_body(body_path)
    held = None if equipment is None else held_equipment(equipment, with_hands(person) if outside else person)
    body = coupled_body(person, held)
    with open_recording(recording_path) as recording:
        cameras = [camera for camera in recording.cameras if camera in body.mounts]
        readouts = known_readouts(recording, body, cameras)
    rounds = replace(settings, extend=replace(settings.extend, rounds=passes - 1))
    extension = MapExtension(recording_path, map_path, rounds, jobs, cameras, readouts, on_step)
    with scratch_folder(Path(gettempdir())) as scratch:
        extension.run().save(scratch / "map")
        summary = replay(
            recording_path,
            scratch / "map",
            body_path,
            output_path,
            settings,
            jobs,
            force,
            on_progress,
            held,
            on_step,
            outside,
            slim,
        )
    summary.elapsed_s += extension.elapsed_s
    return summary, extension.rounds
