"""Names of strangers' bodies, in a real browser: they are shown as they are, and run nothing."""

from collections.abc import Iterator
from pathlib import Path

import pytest
import yaml
from helpers.view_in_browser import BrowserView, served

from bodycam_ros.viewer.live_session import LiveSession
from bodycam_ros.viewer.placing import support_table
from bodycam_ros.viewer.server import LocalServer

pytestmark = pytest.mark.long

HOSTILE = "<img src=x onerror=window.ran=1>"
SCRIPT = "**x** | <script>window.ran=1</script> [y](javascript:window.ran=1) `"


def test_names_of_a_body_run_nothing(sample: Path, body_file: Path, chromium: str) -> None:
    names = {"knee_left": HOSTILE, "foot_left": SCRIPT, "head": "<b>head</b>"}
    body_file.write_text(yaml.safe_dump(_renamed(yaml.safe_load(body_file.read_text()), names), sort_keys=False))
    with (
        served("--map", sample / "map", "--body", body_file) as running,
        BrowserView.opened(running.address, chromium) as view,
    ):
        for part in (f"joint {HOSTILE}", "camera <b>head</b>"):
            view.choose("move", part)
            view.wait_until(lambda part=part: view.value("move") == part, "the part is chosen")  # type: ignore[misc]
            view.enter("place [m]", "0.5", component=2)
            view.page.get_by_text(f"{part}: ").first.wait_for()
        assert view.page.evaluate("window.ran") is None


@pytest.fixture
def server() -> Iterator[LocalServer]:
    server = LocalServer(0, "test <script>window.ran=1</script>")
    yield server
    server.stop()


def test_what_a_graph_or_a_start_names_runs_nothing(server: LocalServer, chromium: str) -> None:
    server.gui.add_markdown(support_table({HOSTILE: 0.1, SCRIPT: 0.9}))
    session = LiveSession(server, None)
    session.put_body(f"/robot_description cannot be read: joint {HOSTILE}: {SCRIPT}")
    session.step(0.0)
    session._since = 0.0
    session.step(0.0)
    with BrowserView.opened(server.address, chromium, shows="is in the images") as view:
        server.notify("This did not work", f"{HOSTILE} {SCRIPT}", "red")
        for text in (f"joint {HOSTILE}: {SCRIPT}", f"{HOSTILE} {SCRIPT}"):
            view.page.get_by_text(text).first.wait_for()
        for name in (HOSTILE, SCRIPT):
            view.page.get_by_role("cell", name=name, exact=True).wait_for()
        assert view.page.evaluate("window.ran") is None


def _renamed(value: object, names: dict[str, str]) -> object:
    """A file's content with other names."""
    if isinstance(value, dict):
        return {_renamed(key, names): _renamed(entry, names) for key, entry in value.items()}
    if isinstance(value, list):
        return [_renamed(entry, names) for entry in value]
    return names.get(value, value) if isinstance(value, str) else value
