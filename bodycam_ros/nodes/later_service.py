"""A service whose work is done beside the executor, and whose answer waits for it."""

from collections.abc import Callable
from typing import Any

from std_srvs.srv import Trigger

from bodycam_ros.messages.factory import Message
from bodycam_ros.nodes.stage_node import StageNode


class LaterService:
    """A ``std_srvs/Trigger`` whose answer is given later. Those who ask in the meantime get the same answer.

    rclpy's executors hand what a service's callback returns to ``send_response`` at once; here that only notes who
    asked.

    Args:
        node: serves.
        name: of the service.
        on_request: called when somebody asks and nobody waits for an answer yet; guarded.
    """

    def __init__(self, node: StageNode[Any], name: str, on_request: Callable[[], None]) -> None:
        self._on_request = node.guarded(on_request, even_inactive=True)
        self._asking: list[tuple[Message, object]] = []
        service = node.create_service(Trigger, name, lambda request, response: response)
        self._send = service.send_response
        service.send_response = self._note  # type: ignore[method-assign]

    @property
    def is_asked(self) -> bool:
        """Whether somebody waits for an answer."""
        return bool(self._asking)

    def answer(self, success: bool, text: str) -> None:
        """Answer all who ask."""
        asking, self._asking = self._asking, []
        for response, header in asking:
            response.success, response.message = success, text
            self._send(response, header)

    def _note(self, response: Message, header: object) -> None:
        self._asking.append((response, header))
        if len(self._asking) == 1:
            self._on_request()
