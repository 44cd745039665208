"""Passes what people do in their browsers to one thread, in order.

The web server calls back on threads of its own, several at once. Here all that changes the view is done by the one
thread that takes from the inbox, so nothing needs a lock.
"""

import threading
from collections.abc import Callable
from typing import Any, TypeVar

from viser import GuiInputHandle

Action = Callable[[], None]
Value = TypeVar("Value")


class Inbox:
    """Actions to be done."""

    def __init__(self) -> None:
        self._waiting: list[tuple[str | None, Action]] = []
        self._changed = threading.Condition()

    def put(self, action: Action, instead_of: str | None = None) -> None:
        """Add an action.

        Args:
            action: to be done after those that wait already.
            instead_of: a name; actions put under it before that still wait are dropped, as when a slider is dragged
                and only its last place counts.
        """
        with self._changed:
            if instead_of is not None:
                self._waiting = [entry for entry in self._waiting if entry[0] != instead_of]
            self._waiting.append((instead_of, action))
            self._changed.notify()

    def take(self, timeout_s: float | None) -> Action | None:
        """Take the oldest action, waiting for one so long (None: for ever); None if none came."""
        with self._changed:
            self._changed.wait_for(lambda: bool(self._waiting), timeout_s)
            return self._waiting.pop(0)[1] if self._waiting else None


def set_value(handle: GuiInputHandle[Value], value: Value) -> None:
    """Show a value. The input's own callbacks are called with an event of no client."""
    handle.value = value  # type: ignore[misc]  # mypy overlooks the setter, which does not follow its getter


def on_input(handle: GuiInputHandle[Any], act: Callable[[], object]) -> None:
    """Call ``act()`` when a person changes the value, and not when the program does."""

    # A coroutine, because the server runs others on several threads and out of order.
    async def changed(event: Any) -> None:
        if event.client_id is not None:
            act()

    handle.on_update(changed)
