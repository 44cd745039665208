"""The registrars of several cameras over one map that grows, fed by trackers that come, go, and begin anew."""

import time
from collections import defaultdict
from collections.abc import Callable, Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from bodycam_ros.camera import CameraModel
from bodycam_ros.camera.readout import Readout, best_known
from bodycam_ros.camera_pipeline import registrar
from bodycam_ros.errors import BodycamError, SettingsError
from bodycam_ros.live.flow_of_frames import MissedFrames, Skipped
from bodycam_ros.live.solver_health import KnownCameras
from bodycam_ros.mapping.extendable_map import AddedLandmarks, load_added_landmarks
from bodycam_ros.mapping.live_mapper import LiveMapper
from bodycam_ros.messages.health import Health, HealthLevel, RegistrationHealth, few
from bodycam_ros.messages.timing import SaidTiming
from bodycam_ros.output_place import check_output
from bodycam_ros.pipeline_settings import PipelineSettings
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.reference_map import ReferenceMap, check_replaceable
from bodycam_ros.registration.registrar import Registrar
from bodycam_ros.tracking.track_frame import TrackFrame


class KeptMap:
    """A growing map, kept in a folder if one is given.

    It is written now and then on a thread; saving and loading on request take part of a second.

    Args:
        growth: the map as it grows.
        reference_map, map_path: what it grows from, and its folder.
        path: folder to be, of this registration alone; None: nothing is kept.
        on_error: called with each new reason why it could not be written.

    Raises:
        BodycamError: what is kept there belongs to another map, is damaged, or cannot be replaced.
    """

    def __init__(
        self,
        growth: LiveMapper,
        reference_map: ReferenceMap,
        map_path: Path,
        path: Path | None,
        on_error: Callable[[str], object],
    ) -> None:
        self._growth, self._reference_map, self._map_path = growth, reference_map, map_path
        self._path, self._on_error = path, on_error
        self._saved_changes = 0
        self._saved_s = time.monotonic()
        self._failure = ""
        self._writer = ThreadPoolExecutor(1, "kept map")
        self._writing: Future[int] | None = None
        if path is not None:
            check_output(path, [map_path])
            if path.exists():
                check_replaceable(path, force=True)
                if any(path.iterdir()):
                    self.load()

    def health(self) -> Health:
        """What has grown, and whether it is kept."""
        values: dict[str, object] = {
            "growing": self._growth.enabled,
            "landmarks grown": self._growth.landmarks,
            "keyframes kept": self._growth.keyframes,
            "keyframes left out": self._growth.dropped,
            "kept in": self._path or "nowhere",
        }
        if self._path is not None:
            values["changes not saved"] = self._growth.changes - self._saved_changes
        if self._failure:
            return Health("grown map", HealthLevel.WARN, self._failure, values)
        return Health("grown map", HealthLevel.OK, "growing" if self._growth.enabled else "stays as it is", values)

    def save(self) -> str:
        """Save it now.

        Raises:
            BodycamError: it cannot be saved, or no folder is given.
        """
        if self._writing is not None:
            self._writing.exception()  # two must not write one folder
        self._saved_changes, self._failure = self._writes()(), ""
        return f"{self._growth.landmarks} landmarks that have grown saved in {self._path}"

    def load(self) -> str:
        """Go on from what is kept; raises BodycamError."""
        grown: AddedLandmarks = load_added_landmarks(self._folder(), self._reference_map, self._map_path)
        there = self._growth.restore(grown)
        if left_out := len(grown.slots) - there:
            return (
                f"{there} of {len(grown.slots)} landmarks loaded from {self._path}; there is no room for the other "
                f"{left_out} (growth.capacity)"
            )
        self._saved_changes = self._growth.changes
        return f"{there} landmarks loaded from {self._path}"

    def reset(self) -> str:
        """Drop what has grown; raises BodycamError."""
        dropped = self._growth.clear()
        if self._path is not None:
            self.save()  # what was dropped must not come back after a crash
        return f"{dropped} landmarks dropped"

    def grow(self, is_on: bool) -> str:
        """Let it grow, or not."""
        self._growth.enabled = is_on
        return "the map grows" if is_on else "the map stays as it is"

    def look(self, save_interval_s: float) -> None:
        """Write on the thread where it is time to, and take the result."""
        if self._writing is not None and self._writing.done():
            error = self._writing.exception()
            if error is None:
                self._saved_changes, self._failure = self._writing.result(), ""
            elif isinstance(error, BodycamError):
                if str(error) != self._failure:
                    self._on_error(str(error))
                self._failure = str(error)
            else:
                raise error
            self._writing, self._saved_s = None, time.monotonic()
        is_due = time.monotonic() - self._saved_s > save_interval_s
        if self._path is not None and self._writing is None and is_due and self._growth.changes != self._saved_changes:
            self._writing = self._writer.submit(self._writes())

    def stop(self) -> None:
        """Save what has changed, before the node goes; raises BodycamError."""
        self._writer.shutdown()
        self.look(float("inf"))
        if self._path is not None and self._growth.changes != self._saved_changes:
            self.save()

    def _folder(self) -> Path:
        if self._path is None:
            raise SettingsError("nothing is kept on disk: the parameter 'grown_map' names no folder")
        return self._path

    def _writes(self) -> Callable[[], int]:
        """What writes the map as it is now, and returns the number of changes that it holds."""
        path, changes, settled = self._folder(), self._growth.changes, self._growth.map.compact()

        def write() -> int:
            settled.save(path, force=True)
            return changes

        return write


class LiveRegistration:
    """Registers frames of all cameras; one registrar for each, over one map, which grows by what they see.

    Where a tracker begins anew, so does the registrar; where frames are of the middle of a tracker's stream, it asks
    for a keyframe, because only there the tracks carry what they can be named by.

    Args:
        reference_map, map_path: the map and its folder.
        kept_path: folder in which the grown map is kept; None: nowhere.
        cameras: names.
        settings: gives those of all stages as they are now.
        skipped: counts what could not be used.
        on_error: called with each new reason why the map could not be kept.
        want_keyframe: asks a camera's tracker for one.
        soon: calls back once the frames that wait have been registered.

    Attributes:
        growth, kept: the map as it grows, and on disk.

    Raises:
        BodycamError: as of ``KeptMap``.
    """

    def __init__(
        self,
        reference_map: ReferenceMap,
        map_path: Path,
        kept_path: Path | None,
        cameras: tuple[str, ...],
        settings: Callable[[], PipelineSettings],
        skipped: Skipped,
        on_error: Callable[[str], object],
        want_keyframe: Callable[[str], None],
        soon: Callable[[Callable[[], None]], None],
    ) -> None:
        self._settings, self._skipped, self._want_keyframe = settings, skipped, want_keyframe
        self.growth = LiveMapper(reference_map, settings().growth, want_keyframe, soon)
        self.kept = KeptMap(self.growth, reference_map, map_path, kept_path, on_error)
        self._landmarks = len(reference_map.landmark_ids)
        self._models: dict[str, CameraModel] = {}
        self._registrars: dict[str, Registrar] = {}
        self._described: set[str] = set()
        self._latest_ns: dict[str, int] = {}
        self._readouts: defaultdict[str, dict[str, Readout]] = defaultdict(dict)
        self._missed = MissedFrames()
        self._health = RegistrationHealth(cameras)
        self._frames, self._work_s = 0, 0.0

    @property
    def cameras(self) -> Mapping[str, Registrar]:
        """Those that are registered."""
        return self._registrars

    def use(self, camera: str, model: CameraModel | None) -> None:
        """A camera's model is known, or has become another; None: it cannot be used."""
        self._registrars.pop(camera, None)
        self._models.pop(camera, None)
        if model is not None:
            self._models[camera] = model
            self._begin(camera)

    def begin_anew(self) -> int:
        """Nothing is known of the tracks; how many cameras there are."""
        self._missed = MissedFrames()
        for camera in self._registrars:
            self._begin(camera)
        return len(self._registrars)

    def settings_changed(self) -> None:
        """Register the next images by the thresholds that hold now."""
        for each in self._registrars.values():
            each.settings = self._settings().registrar

    def learn(self, camera: str, timing: SaidTiming) -> None:
        """How long the rows are read out: camera and body may both know; the better known counts."""
        if timing.readout is not None:
            self._readouts[camera][timing.source] = timing.readout
            if camera in self._registrars:
                self._registrars[camera].set_readout(timing.readout)

    def register(self, frame: TrackFrame) -> LandmarkMatches:
        """Register a frame of a camera that is in use."""
        started_s = time.monotonic()
        camera = frame.camera
        # Another tracker, or another time: its track ids begin anew, and are not those that are known.
        if frame.previous_stamp_ns == 0 or frame.stamp_ns <= self._latest_ns.get(camera, 0):
            self._begin(camera)
        self._latest_ns[camera] = frame.stamp_ns
        if self._missed.add(camera, frame.stamp_ns, frame.previous_stamp_ns):
            self._described.discard(camera)
            reason = f"camera {camera}: the track message before {frame.stamp_ns} ns is lost"
            self._skipped.add("track messages lost", reason)
        if frame.keyframe:
            self._described.add(camera)
        elif camera not in self._described:
            self._want_keyframe(camera)
        matches = self._registrars[camera].register(frame)
        self._health.add(matches)
        self.growth.update(frame, matches)
        self._frames += 1
        self._work_s += time.monotonic() - started_s
        return matches

    def health(self, cameras: KnownCameras, waiting: tuple[str, ...]) -> list[Health]:
        """How the cameras fared since the last report; several of these nodes may share them.

        Args:
            cameras: what is known of them.
            waiting: those whose frames wait for readers or for camera_info.
        """
        frames, work_s, self._frames, self._work_s = self._frames, self._work_s, 0, 0.0
        skipped, lost, missing = self._skipped, self._skipped.lately(), cameras.missing
        values: dict[str, object] = {
            "frames per second": frames,
            "time per frame [ms]": round(1e3 * work_s / frames, 1) if frames else "none",
            "cameras": len(self._registrars),
            "cameras refused": ", ".join(sorted(cameras.refused)) or "none",
            "cameras without camera_info": ", ".join(missing) or "none",
            "camera_info changed": cameras.changes,
            "landmarks in the map": self._landmarks,
            **skipped.counts,
            "last error": skipped.latest or "none",
        }
        if unknown := [camera for camera in missing if camera in waiting]:
            level, text = HealthLevel.ERROR, f"tracks, but no camera_info of {few(unknown)}"
        elif cameras.refused:
            level, text = HealthLevel.ERROR, f"no usable camera_info of {few(sorted(cameras.refused))}"
        elif waiting:
            level, text = HealthLevel.WARN, f"waits until more nodes read the landmarks of {few(sorted(waiting))}"
        elif lost:
            level, text = HealthLevel.WARN, f"registering, with losses: {skipped.latest}"
        elif frames:
            level, text = HealthLevel.OK, "registering"
        else:
            level, text = HealthLevel.STALE, "no tracks come"
        return [Health("all cameras", level, text, values), self.kept.health(), *self._health.report()]

    def _begin(self, camera: str) -> None:
        """Nothing is known of the camera's tracks."""
        known, model = best_known(*self._readouts[camera].values()), self._models[camera]
        self._registrars[camera] = registrar(model, self.growth.map, self._settings(), known)
        self.growth.start_camera(camera, model)
        self._described.discard(camera)
