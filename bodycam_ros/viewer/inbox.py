"""Actions on a view, in order and on one thread.

The web server calls back on several threads at once. All changes of the view are made by the one thread that takes
actions from the inbox, so no lock is needed.
"""

import threading
from collections.abc import Callable
from functools import partial
from typing import Any, TypeVar

from viser import CommandHandle, GuiButtonHandle, GuiInputHandle

Action = Callable[[], None]
Value = TypeVar("Value")


class Inbox:
    """A queue of actions."""

    def __init__(self) -> None:
        self._queue: list[tuple[str | None, Action]] = []
        self._changed = threading.Condition()

    def put(self, action: Action, instead_of: str | None = None) -> None:
        """Append an action.

        Args:
            action: to be done after those in the queue.
            instead_of: a name; actions in the queue under this name are dropped: of a slider that is dragged only the
                last position counts.
        """
        with self._changed:
            if instead_of is not None:
                self._queue = [entry for entry in self._queue if entry[0] != instead_of]
            self._queue.append((instead_of, action))
            self._changed.notify()

    def take(self, timeout_s: float | None) -> Action | None:
        """Take the oldest action, or wait for one (None: without end); None after the timeout."""
        with self._changed:
            self._changed.wait_for(lambda: bool(self._queue), timeout_s)
            return self._queue.pop(0)[1] if self._queue else None

    def on_input(
        self, handle: GuiInputHandle[Value], act: Callable[[Value], object], instead_of: str | None = None
    ) -> None:
        """Put ``act(value)`` whenever a person, and not the program, changes an input."""

        # A coroutine, because the server runs others on several threads and out of order.
        async def changed(event: Any) -> None:
            if event.client_id is not None:
                self.put(partial(_call, act, handle.value), instead_of)

        handle.on_update(changed)

    def on_click(self, button: GuiButtonHandle, act: Action) -> None:
        """Put an action whenever a person presses a button."""
        button.on_click(lambda _: self.put(act))

    def on_key(self, command: CommandHandle, act: Action) -> None:
        """Put an action whenever a person presses the key of a command."""

        async def pressed(_: object) -> None:
            self.put(act)

        command.on_trigger(pressed)


def set_value(handle: GuiInputHandle[Value], value: Value) -> None:
    """Show a value. The input's own callbacks are called with an event of no client."""
    handle.value = value  # type: ignore[misc]  # mypy overlooks the setter, which does not follow its getter


def _call(act: Callable[[Value], object], value: Value) -> None:
    act(value)
