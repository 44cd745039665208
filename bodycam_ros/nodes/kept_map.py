"""The registration's map on disk: what has grown is saved now and then, and is there again after a crash."""

import threading
import time
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Generic, TypeVar

from std_srvs.srv import SetBool, Trigger

from bodycam_ros.errors import BodycamError
from bodycam_ros.growth.growing_map import GrownLandmarks
from bodycam_ros.growth.live_growth import LiveGrowth
from bodycam_ros.growth.saved_growth import load_growth
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.nodes.later_service import LaterService
from bodycam_ros.nodes.parameters import RegistrationParameters
from bodycam_ros.nodes.stage_node import StageNode
from bodycam_ros.output_place import check_output
from bodycam_ros.registration.reference_map import ReferenceMap, check_replaceable

T = TypeVar("T")

_LOOK_S = 0.2
_STOP_S = 20.0
_NOWHERE = "nothing is kept on disk: the parameter 'grown_map' names no folder"


class KeptMap:
    """Services ~/save_map, ~/load_map, ~/reset_map and ~/grow, and a folder if the parameter ``grown_map`` names one.

    The folder is ``grown_map``/<name of the node>: several registrations grow their own, and may be given the same
    parameters. Reading and writing go on beside the executor.

    Args:
        node: the registration.
        growth: its map.
        reference_map: what that grows from.

    Raises:
        BodycamError: what is kept there belongs to another map, is damaged, or cannot be replaced.
    """

    def __init__(
        self, node: StageNode[RegistrationParameters], growth: LiveGrowth, reference_map: ReferenceMap
    ) -> None:
        self._node, self._growth, self._reference_map = node, growth, reference_map
        self._map_path = Path(node.required("map"))
        kept = node.parameters.grown_map
        self.path = Path(kept, node.get_fully_qualified_name().strip("/")) if kept else None
        self._saved_changes = 0
        self._saved_s = time.monotonic()
        self._failure = ""
        self._is_urgent = self._is_answer = False
        self._told = ""
        self._saving: _Beside[int] | None = None
        self._loading: _Beside[GrownLandmarks] | None = None
        self._save = LaterService(node, "~/save_map", lambda: self._start(self._save))
        self._load = LaterService(node, "~/load_map", lambda: self._start(self._load))
        if self.path is not None:
            self._begin(self.path)
        node.create_service(Trigger, "~/reset_map", self._on_reset)
        node.create_service(SetBool, "~/grow", self._on_grow)
        node.every(_LOOK_S, self._look, even_inactive=True)

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
        for beside in (self._saving, self._loading):
            if beside is not None:
                beside.join(_STOP_S)
        self._finish_saving()
        self._finish_loading()
        if self.path is not None and self._saving is None and (self._is_changed or self._save.is_asked):
            self._growth.map.settled().save(self.path, force=True)
            self._save.answer(True, self._saved)
        for service in (self._save, self._load):
            service.answer(False, "the node was stopped")

    @property
    def _saved(self) -> str:
        return f"{self._growth.landmarks} landmarks that have grown saved in {self.path}"

    @property
    def _is_changed(self) -> bool:
        return self._growth.changes != self._saved_changes

    def _begin(self, path: Path) -> None:
        """Go on from what is kept, if something is."""
        check_output(path, [self._map_path])
        if not path.exists():
            return
        check_replaceable(path, force=True)
        if any(path.iterdir()):
            self._node.get_logger().info(self._go_on_from(load_growth(path, self._reference_map, self._map_path)))

    def _go_on_from(self, grown: GrownLandmarks) -> str:
        """Take what was saved; what that made."""
        there = self._growth.go_on_from(grown)
        left_out = len(grown.slots) - there
        if not left_out:
            self._saved_changes = self._growth.changes
            return f"{there} landmarks loaded from {self.path}"
        return (
            f"{there} of {len(grown.slots)} landmarks loaded from {self.path}; there is no room for the other "
            f"{left_out} (growth.capacity)"
        )

    def _start(self, service: LaterService) -> None:
        """Somebody asks to save or to load."""
        if self.path is None:
            service.answer(False, _NOWHERE)
        else:
            self._look()

    def _look(self) -> None:
        """Take what is done, and begin what is to be done next: one at a time."""
        self._finish_saving()
        self._finish_loading()
        if self.path is None or self._saving is not None or self._loading is not None:
            return
        waited_s = time.monotonic() - self._saved_s
        path, due = self.path, self._is_urgent or waited_s > self._node.parameters.save_interval
        if self._load.is_asked:
            self._loading = _Beside(lambda: load_growth(path, self._reference_map, self._map_path))
        elif self._save.is_asked or (due and self._is_changed):
            changes, settled = self._growth.changes, self._growth.map.settled()
            self._is_urgent, self._is_answer, self._told = False, self._save.is_asked, self._saved

            def save() -> int:
                settled.save(path, force=True)
                return changes

            self._saving = _Beside(save)

    def _finish_saving(self) -> None:
        if self._saving is None or self._saving.is_alive():
            return
        done, self._saving, self._saved_s = self._saving, None, time.monotonic()
        self._tell(done)
        if done.result is not None:
            self._saved_changes = done.result
        # Who asked while it was being written wants what has grown since then as well.
        if self._is_answer:
            self._save.answer(not done.failure, done.failure or self._told)

    def _finish_loading(self) -> None:
        if self._loading is None or self._loading.is_alive():
            return
        done, self._loading = self._loading, None
        self._tell(done)
        told = done.failure if done.result is None else self._go_on_from(done.result)
        self._load.answer(not done.failure, told)

    def _tell(self, done: "_Beside[T]") -> None:
        if done.failure and done.failure != self._failure:
            self._node.get_logger().error("\n".join(filter(None, [done.failure, done.defect])))
        self._failure = done.failure

    def _on_reset(self, request: Message, response: Message) -> Message:
        response.success = True
        response.message = f"{self._growth.forget()} landmarks dropped"
        self._is_urgent = True  # what was dropped must not come back after a crash
        return response

    def _on_grow(self, request: Message, response: Message) -> Message:
        self._growth.is_on = bool(request.data)
        response.success = True
        response.message = "the map grows" if request.data else "the map stays as it is"
        return response


class _Beside(threading.Thread, Generic[T]):
    """Works beside the executor; starts at once.

    Attributes:
        result: once the thread has ended; None after an error.
        failure: the error, for the user; empty if there was none.
        defect: its traceback, if the error is ours.
    """

    def __init__(self, work: Callable[[], T]) -> None:
        super().__init__(name="kept map", daemon=True)
        self._work = work
        self.result: T | None = None
        self.failure = self.defect = ""
        self.start()

    def run(self) -> None:
        """Do the work; for ``start``."""
        try:
            self.result = self._work()
        except BodycamError as error:
            self.failure = str(error)
        except Exception as error:
            self.failure = f"the kept map broke down ({type(error).__name__}: {error}); the node's log says where"
            self.defect = traceback.format_exc()
