"""Registrars of several cameras over one growing map, with trackers that start, stop and restart."""

import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from pathlib import Path

import bodycam_ros.registration.relocalisation  # noqa: F401  it loads pycolmap, which only the main thread may
from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout, best_known
from bodycam_ros.camera_pipeline import registrar
from bodycam_ros.live.camera_diagnostics import KnownCameras, RegistrationDiagnostics
from bodycam_ros.live.dropped_messages import DroppedMessages, LostMessages
from bodycam_ros.live.live_mapper import LiveMapper
from bodycam_ros.live.stored_map import StoredMap
from bodycam_ros.messages.diagnostics import Status, StatusLevel, few
from bodycam_ros.messages.timing import CameraTiming
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.registration.registrar import Registrar
from bodycam_ros.tracking.track_frame import TrackFrame


class LiveRegistration:
    """Registers frames of all cameras: one registrar for each, over one map, which they extend.

    A registrar restarts with its tracker. For frames from the middle of a tracker's stream a keyframe is requested,
    because only keyframes have the descriptors by which tracks are matched to landmarks.

    Args:
        reference_map, map_path: the map and its folder.
        stored_path: folder in which the grown map is stored; None: nowhere.
        cameras: names.
        settings: returns those of all stages as they are now.
        dropped: counts messages that could not be used.
        on_error: called with each new reason why the map could not be stored.
        request_keyframe: requests a keyframe from a camera's tracker.
        call_later: calls a function after the frames that wait have been registered.

    Attributes:
        growth, stored: the map as it grows, and its folder.

    Raises:
        BodycamError: as of ``StoredMap``.
    """

    def __init__(
        self,
        reference_map: ReferenceMap,
        map_path: Path,
        stored_path: Path | None,
        cameras: tuple[str, ...],
        settings: Callable[[], PipelineSettings],
        dropped: DroppedMessages,
        on_error: Callable[[str], object],
        request_keyframe: Callable[[str], None],
        call_later: Callable[[Callable[[], None]], None],
    ) -> None:
        self._settings, self._dropped, self._request_keyframe = settings, dropped, request_keyframe
        self.growth = LiveMapper(reference_map, settings().growth, request_keyframe, call_later)
        self.stored = StoredMap(self.growth, reference_map, map_path, stored_path, on_error)
        self._landmarks = len(reference_map.landmark_ids)
        self._models: dict[str, CameraModel] = {}
        self._registrars: dict[str, Registrar] = {}
        self._described: set[str] = set()
        self._latest_ns: dict[str, int] = {}
        self._readouts: defaultdict[str, dict[str, Readout]] = defaultdict(dict)
        self._lost = LostMessages()
        self._diagnostics = RegistrationDiagnostics(cameras)
        self._frames, self._work_s = 0, 0.0

    @property
    def cameras(self) -> Mapping[str, Registrar]:
        """Cameras that are registered, with their registrars."""
        return self._registrars

    def set_model(self, camera: str, model: CameraModel | None) -> None:
        """Set or replace a camera's model; None: the camera cannot be used."""
        self._registrars.pop(camera, None)
        self._models.pop(camera, None)
        if model is not None:
            self._models[camera] = model
            self._restart(camera)

    def restart(self) -> int:
        """Forget the tracks of all cameras; return the number of cameras."""
        self._lost = LostMessages()
        for camera in self._registrars:
            self._restart(camera)
        return len(self._registrars)

    def update_settings(self) -> None:
        """Use the current thresholds for the next frames."""
        for each in self._registrars.values():
            each.settings = self._settings().registrar

    def set_timing(self, camera: str, timing: CameraTiming) -> None:
        """Use a read-out time; of those of several sources the best known counts."""
        if timing.readout is not None:
            self._readouts[camera][timing.source] = timing.readout
            if camera in self._registrars:
                self._registrars[camera].set_readout(timing.readout)

    def register(self, frame: TrackFrame) -> LandmarkMatches:
        """Register a frame of one of ``cameras``."""
        started_s = time.monotonic()
        camera = frame.camera
        # Another tracker, or time went back: its track ids are new ones.
        if frame.previous_stamp_ns == 0 or frame.stamp_ns <= self._latest_ns.get(camera, 0):
            self._restart(camera)
        self._latest_ns[camera] = frame.stamp_ns
        if self._lost.add(camera, frame.stamp_ns, frame.previous_stamp_ns):
            self._described.discard(camera)
            reason = f"camera {camera}: the track message before {frame.stamp_ns} ns is lost"
            self._dropped.add("track messages lost", reason)
        if frame.keyframe:
            self._described.add(camera)
        elif camera not in self._described:
            self._request_keyframe(camera)
        matches = self._registrars[camera].register(frame)
        self._diagnostics.add(matches)
        self.growth.add_image(frame, matches)
        self._frames += 1
        self._work_s += time.monotonic() - started_s
        return matches

    def report(self, cameras: KnownCameras, waiting: tuple[str, ...]) -> list[Status]:
        """Status of all cameras, of the map and of each camera since the last report.

        Args:
            cameras: their models.
            waiting: cameras whose frames wait for readers or for camera_info.
        """
        frames, work_s, self._frames, self._work_s = self._frames, self._work_s, 0, 0.0
        lost, missing = self._dropped.count_new(), cameras.missing
        values: dict[str, object] = {
            "frames per second": frames,
            "time per frame [ms]": round(1e3 * work_s / frames, 1) if frames else "none",
            "cameras": len(self._registrars),
            "cameras rejected": ", ".join(sorted(cameras.rejected)) or "none",
            "cameras without camera_info": ", ".join(missing) or "none",
            "camera_info changed": cameras.changes,
            "landmarks in the map": self._landmarks,
            **self._dropped.values,
        }
        if unknown := [camera for camera in missing if camera in waiting]:
            level, text = StatusLevel.ERROR, f"tracks, but no camera_info of {few(unknown)}"
        elif cameras.rejected:
            level, text = StatusLevel.ERROR, f"no usable camera_info of {few(sorted(cameras.rejected))}"
        elif waiting:
            level, text = StatusLevel.WARN, f"waiting for more readers of the landmarks of {few(sorted(waiting))}"
        elif lost:
            level, text = StatusLevel.WARN, f"registering, with losses: {self._dropped.latest}"
        elif frames:
            level, text = StatusLevel.OK, "registering"
        else:
            level, text = StatusLevel.STALE, "no tracks arrive"
        return [Status("all cameras", level, text, values), self.stored.report(), *self._diagnostics.report()]

    def _restart(self, camera: str) -> None:
        """Forget the tracks of a camera."""
        readout, model = best_known(*self._readouts[camera].values()), self._models[camera]
        self._registrars[camera] = registrar(model, self.growth.map, self._settings(), readout)
        self.growth.start_camera(camera, model)
        self._described.discard(camera)
