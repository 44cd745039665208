"""The registration's map on disk: what has grown is saved now and then, and is there again after a crash."""

import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from pathlib import Path

from std_srvs.srv import SetBool

from bodycam_ros.errors import BodycamError, SettingsError
from bodycam_ros.growth.growing_map import GrownLandmarks
from bodycam_ros.growth.live_growth import LiveGrowth
from bodycam_ros.growth.saved_growth import load_growth
from bodycam_ros.live.node_parameters import RegistrationParameters
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.nodes.stage_node import Stage
from bodycam_ros.output_place import check_output
from bodycam_ros.registration.reference_map import ReferenceMap, check_replaceable

_LOOK_S = 0.2


class KeptMap:
    """Services ~/save_map, ~/load_map, ~/reset_map and ~/grow, and a folder if the parameter ``grown_map`` names one.

    The folder is ``grown_map``/<name of the node>: several registrations grow their own, and may be given the same
    parameters. It is written now and then beside the executor; a service that saves or loads takes part of a second.

    Args:
        stage: the registration.
        growth: its map.
        reference_map: what that grows from.

    Raises:
        BodycamError: what is kept there belongs to another map, is damaged, or cannot be replaced.
    """

    def __init__(self, stage: Stage[RegistrationParameters], growth: LiveGrowth, reference_map: ReferenceMap) -> None:
        self._stage, self._growth, self._reference_map = stage, growth, reference_map
        self._map_path = Path(stage.required("map"))
        kept = stage.parameters.grown_map
        self.path = Path(kept, stage.node.get_fully_qualified_name().strip("/")) if kept else None
        self._saved_changes = 0
        self._saved_s = time.monotonic()
        self._failure = ""
        self._writer = ThreadPoolExecutor(1, "kept map")
        self._writing: Future[int] | None = None
        if self.path is not None:
            check_output(self.path, [self._map_path])
            if self.path.exists():
                check_replaceable(self.path, force=True)
                if any(self.path.iterdir()):
                    stage.log.info(self._load())
        stage.trigger("~/save_map", lambda: (True, self._save()))
        stage.trigger("~/load_map", lambda: (True, self._load()))
        stage.trigger("~/reset_map", self._reset)
        stage.service(SetBool, "~/grow", lambda request: self._grow(bool(request.data)))
        stage.every(_LOOK_S, self._look, even_inactive=True)

    def health(self) -> Health:
        """What has grown, and whether it is kept."""
        values: dict[str, object] = {
            "growing": self._growth.is_on,
            "landmarks grown": self._growth.landmarks,
            "keyframes kept": self._growth.keyframes,
            "keyframes left out": self._growth.left_out,
            "kept in": self.path or "nowhere",
        }
        if self.path is not None:
            values["changes not saved"] = self._growth.changes - self._saved_changes
        if self._failure:
            return Health("grown map", HealthLevel.WARN, self._failure, values)
        return Health("grown map", HealthLevel.OK, "growing" if self._growth.is_on else "stays as it is", values)

    def stop(self) -> None:
        """Save what has changed, before the node goes.

        Raises:
            BodycamError: it cannot be saved.
        """
        self._writer.shutdown()
        self._look()
        if self.path is not None and self._growth.changes != self._saved_changes:
            self._save()

    def _folder(self) -> Path:
        if self.path is None:
            raise SettingsError("nothing is kept on disk: the parameter 'grown_map' names no folder")
        return self.path

    def _writes(self) -> Callable[[], int]:
        """What writes the map as it is now, and returns the number of changes that it holds."""
        path, changes, settled = self._folder(), self._growth.changes, self._growth.map.settled()

        def write() -> int:
            settled.save(path, force=True)
            return changes

        return write

    def _save(self) -> str:
        if self._writing is not None:
            self._writing.exception()  # two must not write one folder
        self._saved_changes, self._failure = self._writes()(), ""
        return f"{self._growth.landmarks} landmarks that have grown saved in {self.path}"

    def _load(self) -> str:
        grown: GrownLandmarks = load_growth(self._folder(), self._reference_map, self._map_path)
        there = self._growth.go_on_from(grown)
        if left_out := len(grown.slots) - there:
            return (
                f"{there} of {len(grown.slots)} landmarks loaded from {self.path}; there is no room for the other "
                f"{left_out} (growth.capacity)"
            )
        self._saved_changes = self._growth.changes
        return f"{there} landmarks loaded from {self.path}"

    def _reset(self) -> tuple[bool, str]:
        dropped = self._growth.forget()
        if self.path is not None:
            self._save()  # what was dropped must not come back after a crash
        return True, f"{dropped} landmarks dropped"

    def _grow(self, is_on: bool) -> tuple[bool, str]:
        self._growth.is_on = is_on
        return True, "the map grows" if is_on else "the map stays as it is"

    def _look(self) -> None:
        """Write beside the executor where it is time to, and take the result."""
        if self._writing is not None and self._writing.done():
            error = self._writing.exception()
            if error is None:
                self._saved_changes, self._failure = self._writing.result(), ""
            elif isinstance(error, BodycamError):
                if str(error) != self._failure:
                    self._stage.log.error(str(error))
                self._failure = str(error)
            else:
                raise error
            self._writing, self._saved_s = None, time.monotonic()
        is_due = time.monotonic() - self._saved_s > self._stage.parameters.save_interval
        if self.path is not None and self._writing is None and is_due and self._growth.changes != self._saved_changes:
            self._writing = self._writer.submit(self._writes())
