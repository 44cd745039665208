"""What is shown, and what the colours mean."""

from collections.abc import Callable, Mapping

from viser import GuiApi

from bodycam_ros.evaluate.picture_style import LEFT, RIGHT
from bodycam_ros.view.colours import LOST, REGISTERED, SELECTED, UNKNOWN
from bodycam_ros.view.gui_value import on_input
from bodycam_ros.view.inbox import Inbox

_SIDES = ((LEFT, "left"), (RIGHT, "right"))
_CAMERAS = ((REGISTERED, "camera registered"), (LOST, "lost"))
_UNKNOWN = ((UNKNOWN, "camera"),)
_SELECTED = ((SELECTED, "selected"),)


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
        legend = (*_SIDES, *(_CAMERAS if knows_registration else _UNKNOWN), *_SELECTED)
        with gui.add_folder("Show"):
            for label, switch in switches.items():
                self._add_switch(gui, inbox, label, switch)
            gui.add_html(_legend(legend))

    def _add_switch(self, gui: GuiApi, inbox: Inbox, label: str, switch: Callable[[bool], None]) -> None:
        box = gui.add_checkbox(label, True)
        on_input(box, lambda: inbox.put(lambda: switch(bool(box.value))))


def _legend(entries: tuple[tuple[str, str], ...]) -> str:
    square = '<span style="display:inline-block;width:0.8em;height:0.8em;border-radius:0.2em;background:{}"></span> {}'
    rows = "&ensp; ".join(square.format(colour, text.replace(" ", "&nbsp;")) for colour, text in entries)
    return f'<div style="font-size:0.75em;padding:0.1em 0.9em 0.5em;line-height:1.6">{rows}</div>'
