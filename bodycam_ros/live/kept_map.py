"""The map of a registration on disk: what has grown is saved now and then, and is there again after a crash."""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from bodycam_ros.errors import BodycamError, SettingsError
from bodycam_ros.growth.growing_map import GrownLandmarks
from bodycam_ros.growth.live_growth import LiveGrowth
from bodycam_ros.growth.saved_growth import load_growth
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.output_place import check_output
from bodycam_ros.registration.reference_map import ReferenceMap, check_replaceable


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
        growth: LiveGrowth,
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
            "growing": self._growth.is_on,
            "landmarks grown": self._growth.landmarks,
            "keyframes kept": self._growth.keyframes,
            "keyframes left out": self._growth.left_out,
            "kept in": self._path or "nowhere",
        }
        if self._path is not None:
            values["changes not saved"] = self._growth.changes - self._saved_changes
        if self._failure:
            return Health("grown map", HealthLevel.WARN, self._failure, values)
        return Health("grown map", HealthLevel.OK, "growing" if self._growth.is_on else "stays as it is", values)

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
        grown: GrownLandmarks = load_growth(self._folder(), self._reference_map, self._map_path)
        there = self._growth.go_on_from(grown)
        if left_out := len(grown.slots) - there:
            return (
                f"{there} of {len(grown.slots)} landmarks loaded from {self._path}; there is no room for the other "
                f"{left_out} (growth.capacity)"
            )
        self._saved_changes = self._growth.changes
        return f"{there} landmarks loaded from {self._path}"

    def reset(self) -> str:
        """Drop what has grown; raises BodycamError."""
        dropped = self._growth.forget()
        if self._path is not None:
            self.save()  # what was dropped must not come back after a crash
        return f"{dropped} landmarks dropped"

    def grow(self, is_on: bool) -> str:
        """Let it grow, or not."""
        self._growth.is_on = is_on
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
        path, changes, settled = self._folder(), self._growth.changes, self._growth.map.settled()

        def write() -> int:
            settled.save(path, force=True)
            return changes

        return write
