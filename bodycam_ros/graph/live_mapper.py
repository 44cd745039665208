"""Map extension while cameras are registered live.

Keyframes are requested, and processed when no image waits; the map that grows is kept in a folder.
"""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor, wait
from pathlib import Path

from bodycam_ros.camera import CameraModel
from bodycam_ros.errors import BodycamError
from bodycam_ros.files.output_place import check_output
from bodycam_ros.mapping.body_keyframe import KeyframeSelection
from bodycam_ros.mapping.extendable_map import load_added_landmarks, make_extendable
from bodycam_ros.mapping.local_mapper import LocalMapper
from bodycam_ros.mapping.map_settings import ExtensionSettings
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.registration.landmark_matches import LandmarkMatches
from bodycam_ros.registration.map_identity import MapIdentity, map_identity
from bodycam_ros.registration.reference_map import ReferenceMap, check_replaceable
from bodycam_ros.tracking.track_frame import TrackFrame


class LiveMapper(LocalMapper):
    """Extends one map by some cameras that are registered in it.

    Args:
        reference_map: the map that is extended; it is not changed itself.
        settings: whether, and by how much at most.
        request_keyframe: requests new features from a camera's tracker.
        defer: calls back once, after the images that wait by now have been registered.
        on_error: called with each new reason why the map could not be written.
    """

    def __init__(
        self,
        reference_map: ReferenceMap,
        settings: ExtensionSettings,
        request_keyframe: Callable[[str], None],
        defer: Callable[[Callable[[], object]], None],
        on_error: Callable[[str], object] = lambda reason: None,
    ) -> None:
        super().__init__(make_extendable(reference_map, settings.capacity))
        self._reference_map, self._enabled = reference_map, settings.enabled
        self._request_keyframe = request_keyframe
        self._defer = defer
        self._on_error = on_error
        self._selections: dict[str, KeyframeSelection] = {}
        self._dropped = 0  # keyframes, because too many others waited
        self._identity, self._identified_changes = map_identity(self.map), self.map.changes
        self._folder: Path | None = None
        self._saved_changes = 0
        self._saved_s = time.monotonic()
        self._failure = ""
        self._writer = ThreadPoolExecutor(1, "map writer")
        self._writing: Future[None] | None = None

    @property
    def identity(self) -> MapIdentity:
        """Identity of the map as it is now."""
        if self.map.changes != self._identified_changes:
            self._identity, self._identified_changes = map_identity(self.map), self.map.changes
        return self._identity

    def start_camera(self, camera: str, model: CameraModel) -> None:
        """Start, or restart, the tracks of a camera."""
        self._selections[camera] = KeyframeSelection(model)

    def add_image(self, frame: TrackFrame, matches: LandmarkMatches) -> None:
        """Process one registered image of a camera that was started."""
        if not self._enabled:
            return
        selection = self._selections[matches.camera]
        if (keyframe := selection.take_keyframe(frame, matches)) is not None:
            self._dropped += self.wait_for_turn(keyframe, len(self._selections))
            self._defer(lambda: self.add_waiting(1))
        elif selection.is_due(matches):
            self._request_keyframe(matches.camera)

    def keep_in(self, folder: Path, map_path: Path) -> None:
        """Load the landmarks of a folder, if it has any, and write it from now on.

        Args:
            folder: of this registration alone.
            map_path: folder of the reference map.

        Raises:
            BodycamError: the folder belongs to another map, is damaged, or cannot be replaced.
        """
        check_output(folder, [map_path])
        if folder.exists():
            check_replaceable(folder, force=True)
            if any(folder.iterdir()):
                added = load_added_landmarks(folder, self._reference_map, map_path)
                if left_out := len(added) - self.restore(added):
                    self._on_error(
                        f"{folder}: there is no room for {left_out} of its landmarks; raise extension.capacity"
                    )
        self._folder, self._saved_changes = folder, self.map.changes

    def poll(self, save_interval_s: float) -> None:
        """Start writing on a thread if it is due; call it regularly."""
        if self._writing is not None and self._writing.done():
            self._writing.result()  # raises what is no user's error
            self._writing, self._saved_s = None, time.monotonic()
        if self._writing is None and self._unsaved and time.monotonic() - self._saved_s > save_interval_s:
            self._writing = self._writer.submit(self._write, self.map.compact(), self.map.changes)

    def close(self) -> None:
        """Save the changes before the node ends; raises BodycamError, and may be called again then."""
        if self._writing is not None:
            wait([self._writing])
        if self._unsaved and self._folder is not None:
            self.map.compact().save(self._folder, force=True)
        self._writer.shutdown()

    @property
    def _unsaved(self) -> int:
        """Changes that are not in the folder; none without one."""
        return 0 if self._folder is None else self.map.changes - self._saved_changes

    def _write(self, snapshot: ReferenceMap, changes: int) -> None:
        """Write the map as it was at a number of changes."""
        assert self._folder is not None
        try:
            snapshot.save(self._folder, force=True)
        except BodycamError as error:
            if str(error) != self._failure:
                self._on_error(str(error))
            self._failure = str(error)
        else:
            self._saved_changes, self._failure = changes, ""

    def report(self) -> Status:
        """Status of the extension and of its folder."""
        values: dict[str, object] = {
            "extending": self._enabled,
            "landmarks added": self.landmarks,
            "keyframes stored": self.keyframes,
            "keyframes dropped": self._dropped,
            "folder": self._folder or "none",
        }
        if self._folder is not None:
            values["changes not saved"] = self._unsaved
        level, text = StatusLevel.OK, "extending" if self._enabled else "extension is off"
        return Status("extended map", StatusLevel.WARN if self._failure else level, self._failure or text, values)
