"""The web server of the view, for this machine only, and the one thread that changes what its page shows.

viser calls back on several threads at once. What a person does is put into a queue of actions, and all changes of the
page are made by the thread that takes these from it, so no lock is needed.
"""

import logging
import secrets
import sys
import threading
from collections.abc import Callable, Coroutine
from contextlib import redirect_stdout
from io import StringIO
from typing import Any, Literal, TypeVar

import numpy as np
import viser

from bodycam_ros.errors import BodycamError, ViewError
from bodycam_ros.files.shown import printable

HOST = "127.0.0.1"

_TOKEN_BYTES = 16
_POLICY_VIOLATION = 1008  # of the WebSocket protocol
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
    lets any page connect. All three are off here: only a page of this server's own origin may connect, and only with
    the token in ``address``. Other pages and other users of this machine know neither.

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
        self._token = secrets.token_hex(_TOKEN_BYTES)
        with redirect_stdout(StringIO()):
            super().__init__(HOST, port, label, verbose=False)
        # viser hands neither websockets' check of origins nor its HTTP handler through. This runs before any message of
        # a page is read; what connected before there was anything to see has to connect again.
        self._connection.on_client_connect(self._check_page)
        self._connection.disconnect_all_clients()
        self.gui.configure_theme(show_logo=False, show_share_button=False)
        self.gui.main_panel.dock_right()
        if port not in (0, self.get_port()):
            self.stop()
            raise ViewError(
                f"port {port} of this machine is in use (perhaps by another 'bodycam view') or not allowed; choose "
                "another one with --port, or any free one with --port 0"
            )

    @property
    def address(self) -> str:
        """What to open in a browser; the page connects to the address in its query."""
        server = f"{HOST}:{self.get_port()}"
        return f"http://{server}/?websocket=ws://{server}/{self._token}"

    async def _check_page(self, client: viser.infra.WebsockClientConnection) -> None:
        """Close the connection of a page that is not this server's.

        Raises:
            ConnectionRefusedError: it is not; viser then reads nothing from it.
        """
        server = self._connection
        connection = server._live_connections[client.client_id]
        request, port = connection.request, self.get_port()
        origins = {f"http://{name}:{port}" for name in (HOST, "localhost")}
        path, origin = ("", None) if request is None else (request.path, request.headers.get("Origin"))
        if origin in origins and secrets.compare_digest(path.encode(), f"/{self._token}".encode()):
            return
        for clients in (server._live_connections, server._client_state_from_id):
            clients.pop(client.client_id, None)
        await connection.close(_POLICY_VIOLATION, "open the address that bodycam view printed")
        raise ConnectionRefusedError("a page of another origin, or without the token")

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

    def act(self, timeout_s: float | None = None) -> bool:
        """Do the oldest action in the queue, or wait for one (None: without end); False if there was none."""
        with self._changed:
            self._changed.wait_for(lambda: bool(self._queue), timeout_s)
            action = self._queue.pop(0)[1] if self._queue else None
        if action is None:
            return False
        action()
        return True

    def when_pressed(self, action: Action) -> Callable[[object], Coroutine[Any, Any, None]]:
        """What viser is to call when a person presses a button or key, or clicks a node: it puts the action."""

        # A coroutine, because the server runs others on several threads and out of order.
        async def pressed(_: object) -> None:
            self.put(action)

        return pressed

    def on_input(
        self, handle: viser.GuiInputHandle[Value], act: Callable[[Value], object], instead_of: str | None = None
    ) -> None:
        """Put ``act(value)`` whenever a person, and not the program, changes an input.

        A value that the input cannot have, which a page of ours never sends, is taken back.
        """
        possible = handle.value

        async def changed(event: Any) -> None:
            nonlocal possible
            if not _can_be(handle, possible):
                set_value(handle, possible)
                return
            possible = handle.value
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
            sys.stdout.write(f"open {self.address} in a browser; Ctrl-C ends it\n")
            sys.stdout.flush()
            try:
                while True:
                    try:
                        page.step()
                    except BodycamError as error:
                        self.notify("This did not work", str(error), "red")
            finally:
                if unwritten := page.unwritten:
                    sys.stderr.write(printable(f"bodycam: not written to {unwritten}\n"))
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


def _can_be(handle: Any, like: Any) -> bool:
    """Whether an input can have its value: one of its options, or as many finite numbers as another, in its bounds."""
    value = handle.value
    if hasattr(handle, "options"):
        return value in handle.options
    if isinstance(value, bool | str):
        return True
    numbers = np.asarray(value, float)
    low, high = (getattr(handle, bound, None) for bound in ("min", "max"))
    is_inside = (low is None or np.all(numbers >= low)) and (high is None or np.all(numbers <= high))
    return bool(numbers.shape == np.shape(like) and np.all(np.isfinite(numbers)) and is_inside)
