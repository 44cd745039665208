"""An action whose work is done beside the executor, with progress and cancellation."""

from collections.abc import Callable
from typing import Any, Protocol

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.clock import Clock, ClockType
from rclpy.node import Node
from rclpy.task import Future

from bodycam_ros.errors import BodycamError
from bodycam_ros.messages.factory import Message
from bodycam_ros.nodes.parameters import action_class

_POLL_S = 0.2


class Work(Protocol):
    """Work beside the executor.

    Attributes:
        step, share: current step and how much of it is done, 0 to 1.
    """

    step: str
    share: float

    @property
    def result(self) -> tuple[bool, str] | None:
        """Whether it succeeded, and a summary or the error; None while it runs."""

    def cancel(self) -> bool:
        """Stop it without any output; False if it is too late."""


class LaterAction:
    """All goals get one result; a goal that differs from the running one is rejected.

    It lives as long as its node, configured or not: rclpy answers a goal some cycles of the executor later.

    Args:
        node: serves it.
        type_name: such as "bodycam_msgs/action/Calibrate": its result has ``success`` and ``message``, its feedback
            ``step`` and ``share``.
        name: of the action.
        start: starts the work of a goal; raises BodycamError if that is not possible.

    Attributes:
        work: running work; None if there is none.
    """

    def __init__(self, node: Node, type_name: str, name: str, start: Callable[[Message], Work]) -> None:
        self._node, self._start, self._type = node, start, action_class(type_name)
        self._goals: list[tuple[Any, Future]] = []
        self._progress: tuple[str, float] | None = None
        self.work: Work | None = None
        if self._type is None:
            node.get_logger().warning(f"there is no action {name}, for {type_name} is not built")
            return
        ActionServer(node, self._type, name, self._execute, goal_callback=self._accept, cancel_callback=self._cancel)
        node.create_timer(_POLL_S, self._poll, clock=Clock(clock_type=ClockType.STEADY_TIME))

    def stop(self) -> None:
        """End the work with its stage."""
        self._answer(False, "the node was stopped")

    def _poll(self) -> None:
        """Publish the progress if it has changed, and the result when the work is done."""
        if self.work is None:
            return
        progress = self.work.step, self.work.share
        if progress != self._progress:
            self._progress = progress
            for goal, _ in self._goals:
                goal.publish_feedback(self._type.Feedback(step=progress[0], share=progress[1]))
        if (result := self.work.result) is not None:
            self._answer(*result)

    def _answer(self, success: bool, text: str) -> None:
        goals, self._goals, self._progress, self.work = self._goals, [], None, None
        for goal, future in goals:
            end = goal.succeed if success else goal.canceled if goal.is_cancel_requested else goal.abort
            end()
            future.set_result(self._type.Result(success=success, message=text))

    def _accept(self, goal: Message) -> GoalResponse:
        is_same = not self._goals or goal == self._goals[0][0].request
        return GoalResponse.ACCEPT if is_same else GoalResponse.REJECT

    async def _execute(self, goal: Any) -> Any:
        future = Future(executor=self._node.executor)
        self._goals.append((goal, future))
        try:
            self.work = self.work or self._start(goal.request)
        except (BodycamError, OSError) as error:
            self._answer(False, str(error))
        return await future

    def _cancel(self, goal: Any) -> CancelResponse:
        return CancelResponse.ACCEPT if self.work is not None and self.work.cancel() else CancelResponse.REJECT
