"""A map that grows, kept in a folder."""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from bodycam_ros.errors import BodycamError, SettingsError
from bodycam_ros.live.live_mapper import LiveMapper
from bodycam_ros.mapping.extendable_map import load_added_landmarks
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.output_place import check_output
from bodycam_ros.registration.reference_map import ReferenceMap, check_replaceable


class StoredMap:
    """The landmarks that one registration has added to the reference map, in a folder if one is given.

    They are written regularly on a thread; saving and loading on request take part of a second.

    Args:
        growth: the map as it grows.
        reference_map, map_path: the map before it grew, and its folder.
        path: output folder, of this registration alone; None: nothing is written.
        on_error: called with each new reason why it could not be written.

    Raises:
        BodycamError: the folder belongs to another map, is damaged, or cannot be replaced.
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
        self._writer = ThreadPoolExecutor(1, "stored map")
        self._writing: Future[int] | None = None
        if path is not None:
            check_output(path, [map_path])
            if path.exists():
                check_replaceable(path, force=True)
                if any(path.iterdir()):
                    self.load()

    def report(self) -> Status:
        """Status of the growth and of its folder."""
        values: dict[str, object] = {
            "growing": self._growth.enabled,
            "landmarks added": self._growth.landmarks,
            "keyframes stored": self._growth.keyframes,
            "keyframes dropped": self._growth.dropped,
            "folder": self._path or "none",
        }
        if self._path is not None:
            values["changes not saved"] = self._growth.map.changes - self._saved_changes
        level, text = StatusLevel.OK, "growing" if self._growth.enabled else "growth is off"
        return Status("grown map", StatusLevel.WARN if self._failure else level, self._failure or text, values)

    def save(self) -> str:
        """Save it now.

        Raises:
            BodycamError: it cannot be saved, or no folder is given.
        """
        if self._writing is not None:
            self._writing.exception()  # two threads must not write one folder
        self._saved_changes, self._failure = self._prepare_write()(), ""
        return f"{self._growth.landmarks} added landmarks saved in {self._path}"

    def load(self) -> str:
        """Replace the added landmarks by those of the folder; raises BodycamError."""
        added = load_added_landmarks(self._folder(), self._reference_map, self._map_path)
        loaded = self._growth.restore(added)
        if left_out := len(added) - loaded:
            return (
                f"{loaded} of {len(added)} landmarks loaded from {self._path}; there is no room for the other "
                f"{left_out} (growth.capacity)"
            )
        self._saved_changes = self._growth.map.changes
        return f"{loaded} landmarks loaded from {self._path}"

    def reset(self) -> str:
        """Drop the added landmarks; raises BodycamError."""
        dropped = self._growth.clear()
        if self._path is not None:
            self.save()  # dropped landmarks must not return after a crash
        return f"{dropped} landmarks dropped"

    def set_growth(self, enabled: bool) -> str:
        """Switch the growth on or off."""
        self._growth.enabled = enabled
        return "the map grows" if enabled else "the map does not grow"

    def poll(self, save_interval_s: float) -> None:
        """Start writing if it is due, and take the result of the thread; call it regularly."""
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
        is_due = self._has_changes() and time.monotonic() - self._saved_s > save_interval_s
        if is_due and self._writing is None:
            self._writing = self._writer.submit(self._prepare_write())

    def close(self) -> None:
        """Save the changes before the node ends; raises BodycamError."""
        self._writer.shutdown()
        self.poll(float("inf"))
        if self._has_changes():
            self.save()

    def _has_changes(self) -> bool:
        return self._path is not None and self._growth.map.changes != self._saved_changes

    def _folder(self) -> Path:
        if self._path is None:
            raise SettingsError("the map is not stored: the parameter 'grown_map' names no folder")
        return self._path

    def _prepare_write(self) -> Callable[[], int]:
        """Function that writes the map in its current state, and returns the number of changes in it."""
        path, changes, snapshot = self._folder(), self._growth.map.changes, self._growth.map.compact()

        def write() -> int:
            snapshot.save(path, force=True)
            return changes

        return write
