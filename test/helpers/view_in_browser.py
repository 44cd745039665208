"""Starts ``bodycam view`` as a process of its own, and opens it in a headless Chromium."""

import io
import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from PIL import Image

from helpers.owned_processes import ended_with_us

if TYPE_CHECKING:
    from playwright.sync_api import Locator, Page

REPOSITORY = Path(__file__).parents[2]
WINDOW = (1330, 700)

FLAGS = (
    # WebGL without a graphics card; the page itself is then put together without WebGL, which takes a third as long
    "--enable-unsafe-swiftshader",
    # no sandbox as root, which containers and CI are; no traffic of the browser's own
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
)
_PATIENCE_S = 180.0  # a software renderer on a busy machine
_LOOK_AGAIN_S = 0.3


@dataclass
class Served:
    """A running ``bodycam view``.

    Attributes:
        address: to open.
        errors: its standard error, once it has ended.
    """

    address: str
    errors: str = ""


@contextmanager
def served(*arguments: str | Path) -> Iterator[Served]:
    """Run ``bodycam view`` on any free port, and end it as Ctrl-C does."""
    command = [sys.executable, "-m", "bodycam_ros.cli.main", "view", *map(str, arguments), "--port", "0"]
    pipe = subprocess.PIPE
    with subprocess.Popen(
        ended_with_us(command), stdout=pipe, stderr=pipe, text=True, cwd=REPOSITORY, process_group=0
    ) as process:
        try:
            assert process.stdout is not None
            running = Served(process.stdout.readline().split()[1])
            yield running
        finally:
            os.killpg(process.pid, signal.SIGINT)
            _, errors = process.communicate(timeout=60)
            assert process.returncode == 130, errors
        running.errors = errors


class BrowserView:
    """The page, used as a person uses it."""

    def __init__(self, page: "Page") -> None:
        self.page = page

    @classmethod
    @contextmanager
    def opened(
        cls, address: str, chromium: str, window: tuple[int, int] = WINDOW, shows: str = "follow the body"
    ) -> Iterator["BrowserView"]:
        """Open the page in a window (width, height) [px]; fail if it asks for anything from elsewhere, or stumbles.

        It is ready when it shows a text.
        """
        from playwright.sync_api import sync_playwright  # absent on machines without a browser: fixture ``chromium``

        foreign: list[str] = []
        errors: list[str] = []
        with sync_playwright() as playwright:
            browser = playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
            page = browser.new_page(viewport={"width": window[0], "height": window[1]})
            page.set_default_timeout(_PATIENCE_S * 1e3)
            page.on("request", lambda request: foreign.append(request.url))
            page.on("pageerror", lambda error: errors.append(str(error)))
            page.goto(address)
            page.get_by_text(shows, exact=True).first.wait_for()
            # The renderer's own remark on software rendering, which a graphics card does without.
            page.get_by_text("Software WebGL").wait_for()
            page.locator(".mantine-Notification-closeButton").first.click()
            yield cls(page)
            browser.close()
        own = (address.split("/?")[0], "data:", "blob:")
        assert [url for url in foreign if not url.startswith(own)] == []
        assert errors == []

    def canvas(self) -> tuple[float, float, float, float]:
        """Left, top, width and height of the scene in the window [px]."""
        box = self.page.locator("canvas").first.bounding_box()
        assert box is not None
        return box["x"], box["y"], box["width"], box["height"]

    def picture(self) -> NDArray[np.uint8]:
        """The window (H, W, 3) red, green, blue."""
        return np.asarray(Image.open(io.BytesIO(self.page.screenshot())).convert("RGB"))

    def enter(self, label: str, text: str, component: int = 0) -> None:
        """Type a number into a field of the panel."""
        field = self._row(label).locator("input:visible:not([type=hidden])").nth(component)
        field.fill(text)
        field.press("Enter")

    def value(self, label: str, component: int = 0) -> str:
        """The value of a field of the panel."""
        return self._row(label).locator("input:visible:not([type=hidden])").nth(component).input_value()

    def choose(self, label: str, option: str) -> None:
        """Choose from a list of the panel."""
        self._row(label).locator("input:visible").first.click()
        self.page.get_by_role("option", name=option, exact=True).click()

    def press(self, name: str) -> None:
        """Press a button."""
        self.page.get_by_role("button", name=name, exact=True).click()

    def click(self, place: NDArray[np.float64]) -> None:
        """Click at a point of the window [px]."""
        self.page.mouse.move(*place)
        time.sleep(_LOOK_AGAIN_S)  # the renderer finds out what is beneath the mouse once a frame
        self.page.mouse.click(*place)

    def drag(self, start: NDArray[np.float64], end: NDArray[np.float64], steps: int = 12) -> None:
        """Drag the mouse from one point of the window to another [px]."""
        mouse = self.page.mouse
        mouse.move(*start)
        time.sleep(_LOOK_AGAIN_S)
        mouse.down()
        for share in np.linspace(0.0, 1.0, steps)[1:]:
            mouse.move(*((1.0 - share) * start + share * end))
            time.sleep(_LOOK_AGAIN_S / steps)
        time.sleep(_LOOK_AGAIN_S)
        mouse.up()

    def wait_until(self, is_so: Callable[[], bool], what: str) -> None:
        """Look again and again until something is so."""
        deadline = time.monotonic() + _PATIENCE_S
        while not is_so():
            assert time.monotonic() < deadline, f"not within {_PATIENCE_S:g} s: {what}"
            time.sleep(_LOOK_AGAIN_S)

    def _row(self, label: str) -> "Locator":
        """The smallest part of the page that holds a label of the panel and an input."""
        text = self.page.get_by_text(label, exact=True).locator("visible=true")
        return text.locator("xpath=ancestor::*[.//input][1]")
