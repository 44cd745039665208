"""The web server of the view, for this machine only."""

import logging
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from functools import partial
from io import StringIO
from typing import Literal, Protocol

import viser
from websockets.asyncio import server as websockets_server

from bodycam_ros.errors import BodycamError, ViewError
from bodycam_ros.terminal import Terminal

HOST = "127.0.0.1"

_OUR_PAGES = re.compile(r"http://(127\.0\.0\.1|localhost)(:\d+)?")
"""Origins that may connect: any page of the web that the user has open could reach a server on this machine too."""

_HIGHEST_PORT = 65535
_NOTICE_S = 6.0


class View(Protocol):
    """What happens when a person uses a page. All of it is done in the thread that calls ``step``."""

    @property
    def unwritten(self) -> str:
        """File that something is to be written to, and what; empty if nothing."""

    def step(self) -> None:
        """Do what a person asks for next, or wait for it."""


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

    def serve(self, open_view: Callable[["LocalServer"], View]) -> None:
        """Serve a view until the program is interrupted, and print what it leaves unwritten.

        Raises:
            BodycamError: the view cannot be opened.
        """
        try:
            view = open_view(self)
            Terminal().print(f"open {self.address} in a browser; Ctrl-C ends it")
            try:
                while True:
                    try:
                        view.step()
                    except BodycamError as error:
                        self.notify("This did not work", str(error), "red")
            finally:
                if unwritten := view.unwritten:
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


@contextmanager
def _only_our_pages() -> Iterator[None]:
    """Servers that are started meanwhile refuse other pages: viser does not hand this setting through."""
    serve = websockets_server.serve
    websockets_server.serve = partial(serve, origins=[_OUR_PAGES])  # type: ignore[assignment, misc]
    try:
        yield
    finally:
        websockets_server.serve = serve  # type: ignore[misc]
