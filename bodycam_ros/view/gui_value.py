"""Values of the panel's inputs, set by the program."""

from collections.abc import Callable
from typing import Any, TypeVar

from viser import GuiInputHandle

Value = TypeVar("Value")


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
