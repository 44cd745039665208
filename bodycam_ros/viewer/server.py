"""The web server of the view, for this machine only, and the one thread that changes what its page shows.

viser calls back on several threads at once. What a person does is put into a queue of actions, and all changes of the
page are made by the thread that takes these from it, so no lock is needed.
"""

import logging
import re
import threading
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager, redirect_stdout
from functools import partial
from io import StringIO
from typing import Any, Literal, TypeVar

import viser
from websockets.asyncio import server as websockets_server

from bodycam_ros.errors import BodycamError, ViewError
from bodycam_ros.terminal import Terminal

HOST = "127.0.0.1"

_OUR_PAGES = re.compile(r"http://(127\.0\.0\.1|localhost)(:\d+)?")
"""Origins that may connect: any page of the web that the user has open could reach a server on this machine too."""

_HIGHEST_PORT = 65535
_NOTICE_S = 6.0


Action = Callable[[], object]
Value = TypeVar("Value")


class Page:
    """What a person sees and does; all of it happens in the thread that calls ``step``."""

    def __init__(self, server: "LocalServer") -> None:
        self.server = server

    @property
    def unwritten(self) -> str:
        """File that something is to be written to, and what; empty if nothing."""
        return ""

    def step(self) -> None:
        """Do what a person asks for next, or wait for it."""
        self.server.act()


class LocalServer(viser.ViserServer):
    """viser's server, bound to this machine.

    viser itself takes the next port when one is in use, offers to share the scene through a server of its authors, and
    lets any page connect. All three are off here.

    Raises:
        ViewError: the port cannot be used.
    """

    def __init__(self, port: int, label: str) -> None:
        if not 0 <= port <= _HIGHEST_PORT:
            raise ViewError(f"port {port}: expected 0 (any free port) to {_HIGHEST_PORT}")
        # A page that is closed while it connects would be a traceback.
        logging.getLogger("websockets.server").setLevel(logging.CRITICAL)
        self._queue: list[tuple[str | None, Action]] = []
        self._changed = threading.Condition()
        with redirect_stdout(StringIO()), _only_our_pages():
            super().__init__(HOST, port, label, verbose=False)
        self.gui.configure_theme(show_logo=False, show_share_button=False)
        self.gui.main_panel.dock_right()
        if port not in (0, self.get_port()):
            self.stop()
            raise ViewError(
                f"port {port} of this machine is in use or not allowed; is another 'bodycam view' running? Choose "
                "another one with --port, or any free one with --port 0"
            )

    @property
    def address(self) -> str:
        """What to open in a browser."""
        return f"http://{HOST}:{self.get_port()}"

    def put(self, action: Action, instead_of: str | None = None) -> None:
        """Append an action to the queue.

        Args:
            action: to be done after those in the queue.
            instead_of: a name; actions in the queue under this name are dropped: of a slider that is dragged only the
                last position counts.
        """
        with self._changed:
            self._queue = [entry for entry in self._queue if instead_of is None or entry[0] != instead_of]
            self._queue.append((instead_of, action))
            self._changed.notify()

    def act(self, timeout_s: float | None = None) -> None:
        """Do the oldest action in the queue, or wait for one (None: without end)."""
        with self._changed:
            self._changed.wait_for(lambda: bool(self._queue), timeout_s)
            action = self._queue.pop(0)[1] if self._queue else None
        if action is not None:
            action()

    def when_pressed(self, action: Action) -> Callable[[object], Coroutine[Any, Any, None]]:
        """What viser is to call when a person presses a button or key, or clicks a node: it puts the action."""

        # A coroutine, because the server runs others on several threads and out of order.
        async def pressed(_: object) -> None:
            self.put(action)

        return pressed

    def on_input(
        self, handle: viser.GuiInputHandle[Value], act: Callable[[Value], object], instead_of: str | None = None
    ) -> None:
        """Put ``act(value)`` whenever a person, and not the program, changes an input."""

        async def changed(event: Any) -> None:
            if event.client_id is not None:
                self.put(lambda: act(handle.value), instead_of)

        handle.on_update(changed)

    def serve(self, open_page: Callable[["LocalServer"], Page]) -> None:
        """Serve a page until the program is interrupted, and print what it leaves unwritten.

        Raises:
            BodycamError: the page cannot be opened.
        """
        try:
            page = open_page(self)
            Terminal().print(f"open {self.address} in a browser; Ctrl-C ends it")
            try:
                while True:
                    try:
                        page.step()
                    except BodycamError as error:
                        self.notify("This did not work", str(error), "red")
            finally:
                if unwritten := page.unwritten:
                    Terminal(stderr=True).print(f"bodycam: not written to {unwritten}")
        finally:
            self.stop()

    def notify(self, title: str, text: str, colour: Literal["green", "red"]) -> None:
        """Show a notice in all browsers; a red one stays until it is closed."""
        seconds = None if colour == "red" else _NOTICE_S
        for client in self.get_clients().values():
            client.add_notification(title, text, auto_close_seconds=seconds, color=colour)

    def request_share_url(self, verbose: bool = True) -> str | None:
        """Share nothing; a page that asks for it is not answered."""
        return None

    def stop(self) -> None:
        """Stop serving."""
        with redirect_stdout(StringIO()):
            super().stop()


def set_value(handle: viser.GuiInputHandle[Value], value: Value) -> None:
    """Show a value. The input's own callbacks are called with an event of no client."""
    handle.value = value  # type: ignore[misc]  # mypy overlooks the setter, which does not follow its getter


@contextmanager
def _only_our_pages() -> Iterator[None]:
    """Servers that are started meanwhile refuse other pages: viser does not hand this setting through."""
    serve = websockets_server.serve
    websockets_server.serve = partial(serve, origins=[_OUR_PAGES])  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets_server.serve = serve  # type: ignore[misc]
