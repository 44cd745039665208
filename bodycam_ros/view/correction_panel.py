"""The controls of a correction: what to move, how far it is moved, and undo, reset and write."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np
from viser import GuiApi

from bodycam_ros.view.correction import NO_MOVE, Move, Part
from bodycam_ros.view.inbox import Inbox, on_input, set_value

NOTHING = "nothing"
"""What the list of parts says when no part is selected."""

_UNDO, _RESET = "last step", "this part"
_STEP_MM, _STEP_DEG = 0.1, 0.01


@dataclass(frozen=True)
class CorrectionActions:
    """What to do when a person uses the panel."""

    select: Callable[[Part | None], None]
    move: Callable[[Move], None]
    undo: Callable[[], None]
    reset: Callable[[], None]
    write: Callable[[], None]


class CorrectionPanel:
    """Shows and takes the correction of one selected part."""

    def __init__(
        self, gui: GuiApi, inbox: Inbox, parts: Iterable[Part], file_name: str, actions: CorrectionActions
    ) -> None:
        self._parts = {str(part): part for part in parts}
        with gui.add_folder("Correct"):
            self._part = gui.add_dropdown(
                "move", (NOTHING, *self._parts), hint="or click a camera or a joint in the scene, and drag its arrows"
            )
            self._shift = gui.add_vector3(
                "moved [mm]", (0.0, 0.0, 0.0), step=_STEP_MM, hint="along the segment's axes: forward, left, up"
            )
            self._turn = gui.add_vector3(
                "turned [deg]", (0.0, 0.0, 0.0), step=_STEP_DEG, hint="about the segment's axes: forward, left, up"
            )
            back = gui.add_button_group("take back", (_UNDO, _RESET))
            self._write = gui.add_button(f"Write {file_name}")
            self._moved = gui.add_markdown("")

        on_input(self._part, lambda: inbox.put(partial(actions.select, self._parts.get(self._part.value))))
        for field in (self._shift, self._turn):
            on_input(field, lambda: inbox.put(partial(actions.move, self._entered())))
        back.on_click(lambda event: inbox.put(actions.undo if event.target.value == _UNDO else actions.reset))
        self._write.on_click(lambda _: inbox.put(actions.write))

    def select(self, part: Part | None) -> None:
        """Show another part as the one to be moved."""
        set_value(self._part, NOTHING if part is None else str(part))

    def show(self, move: Move | None, moves: Iterable[tuple[Part, Move]], *, can_turn: bool) -> None:
        """Show how far the selected part (None: no part) and all others are from where the file has them."""
        shown = (NO_MOVE if move is None else move).rounded()
        for field, values in ((self._shift, shown.shift_mm), (self._turn, shown.turn_deg)):
            x, y, z = values.tolist()
            set_value(field, (x, y, z))
        self._shift.disabled = move is None
        self._turn.disabled = not can_turn
        lines = [f"{part}: {moved}" for part, moved in moves]
        self._moved.content = "\n\n".join(["**not written yet**", *lines]) if lines else ""
        self._write.disabled = not lines

    def _entered(self) -> Move:
        return Move(np.array(self._shift.value, dtype=np.float64), np.array(self._turn.value, dtype=np.float64))
