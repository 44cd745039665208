"""What is shown, and what the colours mean."""

from collections.abc import Callable, Mapping

from viser import GuiApi

from bodycam_ros.drawing.picture_style import LEFT, RIGHT
from bodycam_ros.view.inbox import Inbox, on_input
from bodycam_ros.view.scene_nodes import LOST, REGISTERED, SELECTED, UNKNOWN

_PARTS = ((LEFT, "left"), (RIGHT, "right"), (SELECTED, "selected"))
_CAMERAS = ((REGISTERED, "camera registered"), (LOST, "camera lost"))
_UNKNOWN = ((UNKNOWN, "camera"),)


class ShowPanel:
    """A legend, and a switch for each kind of thing."""

    def __init__(
        self,
        gui: GuiApi,
        inbox: Inbox,
        switches: Mapping[str, Callable[[bool], None]],
        *,
        knows_registration: bool,
    ) -> None:
        with gui.add_folder("Show"):
            for label, switch in switches.items():
                self._add_switch(gui, inbox, label, switch)
            gui.add_html(_legend(_PARTS, _CAMERAS if knows_registration else _UNKNOWN))

    def _add_switch(self, gui: GuiApi, inbox: Inbox, label: str, switch: Callable[[bool], None]) -> None:
        box = gui.add_checkbox(label, True)
        on_input(box, lambda: inbox.put(lambda: switch(bool(box.value))))


def _legend(*rows: tuple[tuple[str, str], ...]) -> str:
    square = '<span style="display:inline-block;width:0.8em;height:0.8em;border-radius:0.2em;background:{}"></span> {}'
    lines = ("&ensp; ".join(square.format(colour, text) for colour, text in row) for row in rows)
    return f'<div style="font-size:0.75em;padding:0.1em 0.9em 0.5em;line-height:1.6">{"<br>".join(lines)}</div>'
