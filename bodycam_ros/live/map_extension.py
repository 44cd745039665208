"""``bodycam map extend`` beside the live work: in a process of its own, with the map and settings of a registration."""

import json
import math
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory

import yaml

from bodycam_ros.errors import RecordingError

_GRACE_S = 0.5
"""Cleaning up takes longer on a busy machine; what is left of scratch folders then, the next extension removes."""

_COMPLAINT = "bodycam: error: "
_NICE = 10
"""The live work goes first."""


class MapExtension(threading.Thread):
    """Runs the command and reads its progress; starts at once.

    Args:
        map_path: folder of the map that is extended; it stays as it is.
        recording, output: the recording, and the folder of the extended map.
        settings: of all groups.

    Attributes:
        step, share: as of ``Work``.

    Raises:
        RecordingError: recording or output is missing.
    """

    def __init__(
        self, map_path: Path, recording: str, output: str, settings: Mapping[str, Mapping[str, object]]
    ) -> None:
        if not (recording and output):
            raise RecordingError("say which recording, and which folder is to be the extended map")
        super().__init__(name="map extension", daemon=True)
        self._folder = TemporaryDirectory(prefix="bodycam_extension_")
        config = Path(self._folder.name) / "settings.yaml"
        plain = json.loads(json.dumps(settings))  # lists instead of tuples
        config.write_text(yaml.safe_dump({"/**": {"ros__parameters": plain}}))
        command = ["map", "extend", recording, "--map", str(map_path), "-o", output, "--config", str(config), "--json"]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "bodycam_ros.cli.main", *command],
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            # Ctrl-C is for the node, which ends it, and its workers with it.
            process_group=0,
        )
        os.setpriority(os.PRIO_PROCESS, self._process.pid, _NICE)
        self.step, self.share, self._text = "start", 0.0, ""
        self._code: int | None = None
        self._cancelled_s = math.inf
        self.start()

    @property
    def result(self) -> tuple[bool, str] | None:
        """As of ``Work``."""
        if self.is_alive():
            if time.monotonic() - self._cancelled_s > _GRACE_S:
                self._kill()
            return None
        if self._cancelled_s < math.inf and self._code != 0:
            return False, "called off; nothing was written"
        return self._code == 0, self._text

    def cancel(self) -> bool:
        """As of ``Work``: it cleans up first."""
        self._cancelled_s = time.monotonic()
        self._process.terminate()
        return True

    def stop(self) -> None:
        """Cancel it and wait."""
        self.cancel()
        self.join(_GRACE_S)
        self._kill()

    def run(self) -> None:
        """Read what the command prints; for ``start``."""
        for line in self._process.stdout or ():
            if line.startswith("{"):
                progress = json.loads(line)
                self.step, self.share = progress["step"], progress["share"]
            elif line.strip():
                self._text = line.strip().removeprefix(_COMPLAINT)
        self._code = self._process.wait()
        self._folder.cleanup()

    def _kill(self) -> None:
        """End it and its workers now, if they are there."""
        with suppress(ProcessLookupError):
            os.killpg(self._process.pid, signal.SIGKILL)
