"""An action whose work is done beside the executor: who asks hears how far it is, and may call it off."""

from collections.abc import Callable
from typing import Any, Protocol

from rclpy.action import ActionServer, CancelResponse, GoalResponse
from rclpy.task import Future

from bodycam_ros.messages.factory import Message
from bodycam_ros.nodes.message_classes import action_class
from bodycam_ros.nodes.stage_node import StageNode


class Worker(Protocol):
    """Who works at what an action asks for."""

    def make(self, goal: Message) -> None:
        """Somebody asks; what others asked for, which is the same, may be worked at already."""

    def cancel(self) -> bool:
        """Somebody calls it off; whether it is not too late for that."""


class LaterAction:
    """Goals wait for one answer: those who ask for what is worked at already wait for the same.

    Who asks for something else in the meantime is rejected.

    It lives as long as its node, configured or not, for rclpy answers a goal some turns of the executor later.

    Args:
        node: serves.
        type_name: such as "bodycam_msgs/action/Calibrate": its result has ``success`` and ``message``, its feedback
            ``step`` and ``share``.
        name: of the action.
        worker: who works, while the node is active; None where it was configured to do without.

    Attributes:
        lacking: why nobody can ask; empty if everybody can.
    """

    def __init__(self, node: StageNode[Any], type_name: str, name: str, worker: Callable[[], Worker | None]) -> None:
        self._node, self._worker = node, worker
        self._asking: list[tuple[Any, Future]] = []
        self._told: tuple[str, float] | None = None
        self._type = action_class(type_name)
        self.lacking = "" if self._type else f"there is no action {name}, for {type_name} is not built"
        if self._type is not None:
            ActionServer(
                node, self._type, name, self._execute, goal_callback=self._welcome, cancel_callback=self._cancel
            )

    @property
    def is_asked(self) -> bool:
        """Whether somebody waits for an answer."""
        return bool(self._asking)

    def tell(self, step: str, share: float) -> None:
        """Say how far it is, where that has changed: the step, and the share of it that is done, 0 to 1."""
        if self._asking and (step, share) != self._told:
            self._told = step, share
            for goal, _ in self._asking:
                goal.publish_feedback(self._type.Feedback(step=step, share=share))

    def answer(self, success: bool, text: str) -> None:
        """Answer all who ask."""
        asking, self._asking, self._told = self._asking, [], None
        for goal, future in asking:
            end = goal.succeed if success else goal.canceled if goal.is_cancel_requested else goal.abort
            end()
            future.set_result(self._type.Result(success=success, message=text))

    def _welcome(self, goal: Message) -> GoalResponse:
        is_same = not self._asking or goal == self._asking[0][0].request
        return GoalResponse.ACCEPT if is_same else GoalResponse.REJECT

    async def _execute(self, goal: Any) -> Any:
        future = Future(executor=self._node.executor)
        self._asking.append((goal, future))
        if not self._node.is_active:
            self.answer(False, f"the node is {self._node.state}; activate it first")
        elif (worker := self._worker()) is None:
            self.answer(False, "the node was configured to do without it")
        else:
            self._node.guarded(worker.make)(goal.request)
        return await future

    def _cancel(self, goal: Any) -> CancelResponse:
        worker = self._worker()
        return CancelResponse.ACCEPT if worker is not None and worker.cancel() else CancelResponse.REJECT
