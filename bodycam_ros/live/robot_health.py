"""How a robot follows a body."""

from bodycam_ros.live.flow_of_frames import Skipped
from bodycam_ros.messages.status import Health, HealthLevel
from bodycam_ros.robot.retargeting import RobotState


class RobotHealth:
    """Counts what a robot does between two reports.

    Args:
        skipped: instants and bodies that it could not follow.
    """

    def __init__(self, skipped: Skipped) -> None:
        self._skipped = skipped
        self._forget()

    def _forget(self) -> None:
        self._instants = self._held = 0
        self._farthest_m = 0.0

    def add(self, state: RobotState) -> None:
        """The robot has followed an instant."""
        self._instants += 1
        self._held += state.held
        self._farthest_m = max(self._farthest_m, *state.errors_m.values())

    def report(self, has_body: bool) -> Health:
        """The health since the last report; ``has_body``: whether there is one that it can follow."""
        instants, held = self._instants, self._held
        values: dict[str, object] = {
            "instants per second": instants,
            "farthest hand or foot [cm]": round(100.0 * self._farthest_m, 1),
            "instants held by limits": held,
            **self._skipped.counts,
        }
        self._forget()
        skipped = self._skipped.lately()
        if not instants:
            text = self._skipped.latest if skipped or not has_body else ""
            return Health("robot", HealthLevel.WARN, text or "nothing to follow: no body is solved", values)
        level, text = (HealthLevel.WARN, "its limits hold it back") if held else (HealthLevel.OK, "follows")
        return Health("robot", level, text, values)
