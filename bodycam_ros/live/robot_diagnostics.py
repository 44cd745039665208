"""Diagnostics of a robot that follows the body."""

from bodycam_ros.live.dropped_messages import DroppedMessages
from bodycam_ros.messages.diagnostics import Status, StatusLevel
from bodycam_ros.robot.retargeting import RobotState


class RobotDiagnostics:
    """Counts the frames that a robot follows between two reports.

    Args:
        dropped: frames and bodies that it could not follow.
    """

    def __init__(self, dropped: DroppedMessages) -> None:
        self._dropped = dropped
        self._frames = self._limited = 0
        self._farthest_m = 0.0

    def add(self, state: RobotState) -> None:
        """Count a frame."""
        self._frames += 1
        self._limited += state.blocked
        self._farthest_m = max(self._farthest_m, *state.errors_m.values())

    def report(self, has_body: bool) -> Status:
        """Status since the last report; ``has_body``: whether there is a body that the robot can follow."""
        frames, limited = self._frames, self._limited
        values: dict[str, object] = {
            "frames per second": frames,
            "farthest hand or foot [cm]": round(100.0 * self._farthest_m, 1),
            "frames at joint limits": limited,
            **self._dropped.values,
        }
        self._frames, self._limited, self._farthest_m = 0, 0, 0.0
        dropped = self._dropped.count_new()
        if not frames:
            text = self._dropped.latest if dropped or not has_body else ""
            return Status("robot", StatusLevel.WARN, text or "nothing to follow: no body is solved", values)
        level, text = (StatusLevel.WARN, "at its joint limits") if limited else (StatusLevel.OK, "follows")
        return Status("robot", level, text, values)
