"""Keys of the page: space plays and pauses, arrows step by an instant, with shift by half a second."""

from collections.abc import Callable
from typing import Literal

from viser import GuiApi

from bodycam_ros.view.inbox import Action, Inbox

_LEAP = 15  # instants; half a second at 30 images a second

HELP = "keys: space plays, ← → step, shift + ← → leap, Home and End; A W S D Q E ↑ ↓ move the view"

_Key = Literal["space", "arrowleft", "arrowright", "home", "end"]

# The page turns the view with the arrows to the sides, too. Its listener is on the document, that of our keys on the
# element below: what is stopped there reaches ours alone. A box that was ticked would keep the keyboard to itself.
# Markup is all that a page of viser takes over.
_ARROWS_ARE_OURS = (
    '<img alt="" src="data:," style="display:none" onerror="'
    "document.documentElement.addEventListener('keydown',"
    " e => { if (e.code === 'ArrowLeft' || e.code === 'ArrowRight') e.stopPropagation() });"
    "document.addEventListener('change', e => { if (e.target.type === 'checkbox') e.target.blur() })\">"
)


class Keys:
    """Listens to the keyboard while no field is being typed in."""

    def __init__(
        self,
        gui: GuiApi,
        inbox: Inbox,
        play: Action,
        step: Callable[[int], None],
        go: Callable[[float], None],
    ) -> None:
        self._gui, self._inbox = gui, inbox
        gui.add_html(f'{_ARROWS_ARE_OURS}<div style="font-size:0.75em;padding:0.1em 0.9em 0.7em">{HELP}</div>')
        self._add("play or pause", "space", play)
        self._add("an instant on", "arrowright", lambda: step(1))
        self._add("an instant back", "arrowleft", lambda: step(-1))
        self._add("half a second on", "arrowright", lambda: step(_LEAP), shift=True)
        self._add("half a second back", "arrowleft", lambda: step(-_LEAP), shift=True)
        self._add("to the start", "home", lambda: go(0.0))
        self._add("to the end", "end", lambda: go(float("inf")))

    def _add(self, label: str, key: _Key, act: Action, *, shift: bool = False) -> None:
        command = self._gui.add_command(label, hotkey=key, modifier="shift" if shift else None)

        # A coroutine, because the server runs others on several threads and out of order.
        async def pressed(_: object) -> None:
            self._inbox.put(act)

        command.on_trigger(pressed)
