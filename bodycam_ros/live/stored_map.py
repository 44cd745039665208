"""A map that grows, kept in a folder."""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from bodycam_ros.errors import BodycamError
from bodycam_ros.live.live_mapper import LiveMapper
from bodycam_ros.mapping.extendable_map import load_added_landmarks
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.output_place import check_output
from bodycam_ros.registration.reference_map import ReferenceMap, check_replaceable


class StoredMap:
    """The landmarks that one registration has added to the reference map, in a folder if one is given.

    Those that are there already are loaded. They are written regularly on a thread.

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
        self._growth, self._path, self._on_error = growth, path, on_error
        self._saved_s, self._failure = time.monotonic(), ""
        self._writer = ThreadPoolExecutor(1, "stored map")
        self._writing: Future[int] | None = None
        if path is not None:
            check_output(path, [map_path])
            if path.exists():
                check_replaceable(path, force=True)
                if any(path.iterdir()):
                    added = load_added_landmarks(path, reference_map, map_path)
                    if left_out := len(added) - growth.restore(added):
                        on_error(f"{path}: there is no room for {left_out} of its landmarks; raise growth.capacity")
        self._saved_changes = growth.map.changes

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

    def poll(self, save_interval_s: float) -> None:
        """Start writing if it is due, and take the result of the thread; call it regularly."""
        if self._writing is not None and self._writing.done():
            writing, self._writing, self._saved_s = self._writing, None, time.monotonic()
            try:
                self._saved_changes, failure = writing.result(), ""
            except BodycamError as error:
                failure = str(error)
                if failure != self._failure:
                    self._on_error(failure)
            self._failure = failure
        is_due = time.monotonic() - self._saved_s > save_interval_s
        if self._writing is None and is_due and (write := self._prepare_write()) is not None:
            self._writing = self._writer.submit(write)

    def close(self) -> None:
        """Save the changes before the node ends; raises BodycamError."""
        self._writer.shutdown()
        self.poll(float("inf"))
        if (write := self._prepare_write()) is not None:
            write()

    def _prepare_write(self) -> Callable[[], int] | None:
        """Function that writes the map in its current state, and returns the number of changes in it; None if saved."""
        path, changes = self._path, self._growth.map.changes
        if path is None or changes == self._saved_changes:
            return None
        snapshot = self._growth.map.compact()

        def write() -> int:
            snapshot.save(path, force=True)
            return changes

        return write
