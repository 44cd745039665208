"""Panel by which a person moves one part of a body or of a start at a time, by numbers where handles are too coarse."""

from collections.abc import Callable, Sequence

import numpy as np
from viser import GuiApi, GuiFolderHandle

from bodycam_ros.geometry import Array
from bodycam_ros.viewer.inbox import Action, Inbox, set_value

_DECIMALS, _STEP_M = 4, 0.0001


class EditPanel:
    """Shows and takes the place of one chosen part.

    Attributes:
        folder: that the panel is in.
    """

    def __init__(
        self,
        gui: GuiApi,
        inbox: Inbox,
        title: str,
        parts: Sequence[str],
        file_name: str,
        *,
        select: Callable[[str], None],
        move_to: Callable[[Array], None],
        undo: Action,
        write: Action,
        text: str,
    ) -> None:
        self.folder: GuiFolderHandle = gui.add_folder(title)
        self._position_m = np.zeros(3)
        with self.folder:
            gui.add_markdown(text)
            self._part = gui.add_dropdown("move", tuple(parts))
            self._place = gui.add_vector3("place [m]", (0.0, 0.0, 0.0), step=_STEP_M)
            inbox.on_click(gui.add_button("Undo"), undo)
            self._write = gui.add_button(f"Write {file_name}")
            self._remark = gui.add_markdown("")
        inbox.on_input(self._part, select)
        inbox.on_input(self._place, lambda place: self._enter(np.array(place), move_to))
        inbox.on_click(self._write, write)

    def show(self, part: str, position_m: Array | None, *, can_move: bool = True) -> None:
        """Show the chosen part, and where it is (3,) in what carries it [m]."""
        self._position_m = np.round(np.zeros(3) if position_m is None else position_m, _DECIMALS) + 0.0
        x, y, z = self._position_m.tolist()
        set_value(self._part, part)
        set_value(self._place, (x, y, z))
        self._place.disabled = position_m is None or not can_move

    def remark(self, text: str, *, can_write: bool = True) -> None:
        """Show a remark, and whether there is something to write."""
        self._remark.content = text
        self._write.disabled = not can_write

    def _enter(self, place: Array, move_to: Callable[[Array], None]) -> None:
        # A field that loses the focus sends its number again.
        if not np.array_equal(np.round(place, _DECIMALS), self._position_m):
            move_to(place)
