"""An action whose work is done beside the executor: whoever asks gets its progress, and can cancel it."""

from collections.abc import Callable
from typing import Any, Protocol

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.node import Node
from rclpy.task import Future

from bodycam_ros.errors import BodycamError
from bodycam_ros.messages.factory import Message
from bodycam_ros.nodes.message_classes import action_class


class Worker(Protocol):
    """Does the work of an action."""

    def work_on(self, goal: Message) -> None:
        """Begin, unless the same work is under way."""

    def cancel(self) -> bool:
        """Cancel the work; False where it is too late."""


class LaterAction:
    """Goals wait for one answer; a goal that differs from the one that is worked at is rejected.

    It lives as long as its node, configured or not: rclpy answers a goal some turns of the executor later.

    Args:
        node: serves it.
        type_name: such as "bodycam_msgs/action/Calibrate": its result has ``success`` and ``message``, its feedback
            ``step`` and ``share``.
        name: of the action.
        worker: does the work; None while the node is not active, or was configured without it.
    """

    def __init__(self, node: Node, type_name: str, name: str, worker: Callable[[], Worker | None]) -> None:
        self._node, self._worker, self._type = node, worker, action_class(type_name)
        self._goals: list[tuple[Any, Future]] = []
        self._progress: tuple[str, float] | None = None
        if self._type is None:
            node.get_logger().warning(f"there is no action {name}, for {type_name} is not built")
            return
        ActionServer(node, self._type, name, self._execute, goal_callback=self._accept, cancel_callback=self._cancel)

    @property
    def is_asked(self) -> bool:
        """Whether a goal waits for its answer."""
        return bool(self._goals)

    def report(self, step: str, share: float) -> None:
        """Publish the progress where it has changed: the step, and the share of it that is done, 0 to 1."""
        if (step, share) != self._progress:
            self._progress = step, share
            for goal, _ in self._goals:
                goal.publish_feedback(self._type.Feedback(step=step, share=share))

    def answer(self, success: bool, text: str) -> None:
        """Answer all goals."""
        goals, self._goals, self._progress = self._goals, [], None
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
        worker = self._worker()
        try:
            if worker is None:
                self.answer(False, "the node is not active, or was configured without it")
            else:
                worker.work_on(goal.request)
        except BodycamError as error:
            self.answer(False, str(error))
        return await future

    def _cancel(self, goal: Any) -> CancelResponse:
        worker = self._worker()
        return CancelResponse.ACCEPT if worker is not None and worker.cancel() else CancelResponse.REJECT
