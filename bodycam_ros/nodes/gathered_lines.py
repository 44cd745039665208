"""Lines of a node's log on several cameras, gathered until no more come: equal ones are one line."""

import time
from typing import Any

from bodycam_ros.files.merged_lines import merge_lines
from bodycam_ros.nodes.stage_node import Stage

_QUIET_S = 2.0  # cameras are discovered one after the other


class GatheredLines:
    """Errors and warnings that are logged two seconds after the latest of them.

    Args:
        stage: in whose log they are.

    Attributes:
        errors, warnings: those that wait, as ``merge_lines`` takes them.
    """

    def __init__(self, stage: Stage[Any]) -> None:
        self._log = stage.log
        self.errors: list[str] = []
        self.warnings: list[str] = []
        self._found, self._latest_s = 0, time.monotonic()
        stage.watch(self._log_lines)

    def _log_lines(self) -> None:
        found, before = len(self.errors) + len(self.warnings), self._found
        if found != before:
            self._found, self._latest_s = found, time.monotonic()
        if time.monotonic() - self._latest_s < _QUIET_S:
            return
        # Two loops: rclpy allows one severity for each line of code.
        for line in merge_lines(sorted(self.errors)):
            self._log.error(line)
        for line in merge_lines(sorted(self.warnings)):
            self._log.warning(line)
        self.errors, self.warnings, self._found = [], [], 0
