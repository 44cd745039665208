"""The registration's map, extended by a recording for the asking: in a process of its own, beside the live work."""

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

from bodycam_ros.errors import BodycamError, RecordingError
from bodycam_ros.live.node_parameters import RegistrationParameters
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.nodes.stage_node import Stage

EXTEND_MAP_TYPE = "bodycam_msgs/action/ExtendMap"

_LOOK_S = 0.2
_GRACE_S = 0.5
"""Cleaning up takes longer on a busy machine; what is left of scratch folders then, the next extension removes."""

_COMPLAINT = "bodycam: error: "
_NICE = 10
"""The live work goes first."""


class MapExtension:
    """Does what ``bodycam map extend`` does, with the map and the settings of a registration.

    Args:
        stage: the registration.
        map_path: folder of the map that is extended; it stays as it is.
    """

    def __init__(self, stage: Stage[RegistrationParameters], map_path: Path) -> None:
        self._stage, self._map_path = stage, map_path
        self._run: _Run | None = None
        stage.every(_LOOK_S, self._look)

    def make(self, goal: Message) -> None:
        """Begin, unless that has been done."""
        if self._run is not None:
            return
        try:
            if not (goal.recording and goal.output):
                raise RecordingError("say which recording, and which folder is to be the extended map")
            command = ["map", "extend", str(self._map_path), goal.recording, "-o", goal.output]
            self._run = _Run(command, self._stage.settings.as_mapping())
        except (BodycamError, OSError) as error:
            self._answer(False, str(error))

    def cancel(self) -> bool:
        """Call it off; it answers once it has cleaned up."""
        if self._run is not None:
            self._run.end()
        return True

    def stop(self) -> None:
        """Give up what is being worked at."""
        if self._run is not None:
            self._run.end()
            self._run.join(_GRACE_S)
            self._run.kill()
            self._run = None
        self._answer(False, "the node was stopped")

    def health(self) -> list[Health]:
        """How far it is, while something is worked at."""
        if self._run is None:
            return []
        values: dict[str, object] = {"step": self._run.step, "done [%]": round(100 * self._run.share)}
        return [Health("map extension", HealthLevel.OK, "extending", values)]

    def _answer(self, success: bool, text: str) -> None:
        if self._stage.node.action is not None:
            self._stage.node.action.answer(success, text)

    def _look(self) -> None:
        if self._run is None:
            return
        if self._stage.node.action is not None:
            self._stage.node.action.report(self._run.step, self._run.share)
        if self._run.is_late:
            self._run.kill()
        if not self._run.is_alive():
            done, self._run = self._run, None
            is_made = done.code == 0
            called_off = done.is_called_off and not is_made
            self._answer(is_made, "called off; nothing was written" if called_off else done.text)


class _Run(threading.Thread):
    """Runs the command and hears what it says; starts at once.

    Attributes:
        step, share: what it is doing and how much of that is done, 0 to 1.
        text: the last line that it said.
        code: its exit code, once the thread has ended.
    """

    def __init__(self, command: list[str], settings: dict[str, dict[str, object]]) -> None:
        super().__init__(name="map extension", daemon=True)
        self._folder = TemporaryDirectory(prefix="bodycam_extension_")
        config = Path(self._folder.name) / "settings.yaml"
        plain = json.loads(json.dumps(settings))  # lists instead of tuples
        config.write_text(yaml.safe_dump({"/**": {"ros__parameters": plain}}))
        self._process = subprocess.Popen(
            [sys.executable, "-m", "bodycam_ros.cli.main", *command, "--config", str(config), "--tell"],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            # Ctrl-C is for the node, which ends it, and its workers with it.
            process_group=0,
        )
        os.setpriority(os.PRIO_PROCESS, self._process.pid, _NICE)
        self.step, self.share, self.text = "start", 0.0, ""
        self.code: int | None = None
        self._ended_s = math.inf
        self.start()

    def end(self) -> None:
        """Let it clean up and end, unless it has."""
        self._ended_s = time.monotonic()
        self._process.terminate()

    @property
    def is_called_off(self) -> bool:
        """Whether it was told to end."""
        return self._ended_s < math.inf

    @property
    def is_late(self) -> bool:
        """Whether it was to have ended by now."""
        return time.monotonic() - self._ended_s > _GRACE_S

    def kill(self) -> None:
        """End it and its workers now, if they are there."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)

    def run(self) -> None:
        """Listen; for ``start``."""
        for line in self._process.stdout or ():
            if line.startswith("{"):
                told = json.loads(line)
                self.step, self.share = told["step"], told["share"]
            elif line.strip():
                self.text = line.strip().removeprefix(_COMPLAINT)
        self.code = self._process.wait()
        self._folder.cleanup()
