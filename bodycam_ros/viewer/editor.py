"""Handles in the scene, and a panel of numbers, by which a person moves one part of a body or of a start at a time."""

from collections.abc import Callable, Mapping
from typing import Any, Generic, Protocol, Self, TypeVar

import numpy as np
from viser import GuiFolderHandle, TransformControlsEvent, TransformControlsHandle

from bodycam_ros.geometry import Array, rigid, rotation_from_xyzw
from bodycam_ros.viewer.scene import place
from bodycam_ros.viewer.server import Action, LocalServer, set_value

SIZE_M = 0.22
"""Length of the arrows."""

_STILL = 1e-9  # [m], and of a rotation matrix: handles that were not moved
_DECIMALS, _STEP_M = 4, 0.0001  # of the numbers


class Edited(Protocol):
    """Something with parts that a person moves: ``Correction`` or ``Placement``."""

    def moved_to(self, part: Any, pose: Array, /) -> Self:
        """The same with a part at a pose (4, 4) [m]."""


E = TypeVar("E", bound=Edited)


class Editor(Generic[E]):
    """Shows and takes the pose of one chosen part, and keeps all steps, to be undone.

    Args:
        server: whose page has the handles and the panel.
        title, text: of the panel.
        parts: name -> part to choose from; None: no part.
        edited: that the parts are of.
        file_name: of what is written.
        select: called with the part that is chosen in the panel.
        changed: called when ``edited`` is another; calls ``show`` with the pose that the chosen part then has.
        write: called by a button.

    Attributes:
        folder: that the panel is in.
    """

    def __init__(
        self,
        server: LocalServer,
        title: str,
        text: str,
        parts: Mapping[str, Any],
        edited: E,
        file_name: str,
        *,
        select: Callable[[Any], None],
        changed: Action,
        write: Action,
    ) -> None:
        self._server = server
        self._parts = parts
        self._steps = [edited]
        self._changed = changed
        self._controls: TransformControlsHandle | None = None
        self._chosen = ""
        self._parent_T_part = np.eye(4)
        self._continues = self._is_dragged = False
        gui = server.gui
        self.folder: GuiFolderHandle = gui.add_folder(title)
        with self.folder:
            gui.add_markdown(text)
            self._part = gui.add_dropdown("move", tuple(parts))
            self._place = gui.add_vector3("place [m]", (0.0, 0.0, 0.0), step=_STEP_M)
            self._undo = gui.add_button("Undo", disabled=True)
            self._write = gui.add_button(f"Write {file_name}")
            self._remark = gui.add_markdown("")
        server.on_input(self._part, lambda name: select(parts[name]))
        server.on_input(self._place, self._enter)
        self._undo.on_click(server.when_pressed(self.undo))
        self._write.on_click(server.when_pressed(write))

    @property
    def edited(self) -> E:
        """What is edited, as it is now."""
        return self._steps[-1]

    def restart(self, edited: E) -> None:
        """Edit another, without a step to be undone."""
        self._take_steps([edited])

    def change(self, edited: E) -> None:
        """Take one more step."""
        self._take_steps([*self._steps, edited])

    def undo(self) -> None:
        """Go back by a step, if one was taken."""
        self._take_steps(self._steps[:-1] or self._steps)

    def move(self, parent_T_part: Array, *, continues: bool = False) -> None:
        """Move the chosen part to a pose (4, 4) [m]; ``continues``: in place of the last step, as in a drag."""
        part = self._parts[self._chosen]
        if part is not None:
            kept = (self._steps[:-1] if continues else []) or self._steps
            self._take_steps([*kept, kept[-1].moved_to(part, parent_T_part)])

    def _take_steps(self, steps: list[E]) -> None:
        self._steps = steps
        self._undo.disabled = len(steps) < 2
        self._changed()

    def show(
        self,
        part: str,
        parent: str = "",
        parent_T_part: Array | None = None,
        *,
        can_move: bool = True,
        can_turn: bool = True,
    ) -> None:
        """Show the chosen part at a pose (4, 4) in a node of the scene [m]: arrows if it can move, arcs if it can turn.

        Without a pose nothing is chosen. Where a drag has taken the part, its handles follow when they are released.
        """
        if part != self._chosen:
            self._chosen = part
            self._attach(parent if parent_T_part is not None else None, can_move, can_turn)
        self._parent_T_part = np.eye(4) if parent_T_part is None else parent_T_part
        if self._is_dragged:
            self._continues = True
        else:
            self._release()
        x, y, z = self._position.tolist()
        set_value(self._part, part)
        set_value(self._place, (x, y, z))
        self._place.disabled = parent_T_part is None or not can_move

    def remark(self, text: str, *, can_write: bool = True) -> None:
        """Show a remark (Markdown: see ``markdown_text``), and whether there is something to write."""
        self._remark.content = text
        self._write.disabled = not can_write

    @property
    def _position(self) -> Array:
        """(3,) as the panel shows it [m]."""
        return np.asarray(np.round(self._parent_T_part[:3, 3], _DECIMALS) + 0.0)

    def _attach(self, parent: str | None, can_move: bool, can_turn: bool) -> None:
        """Put handles into a node of the scene, or remove them."""
        if self._controls is not None:
            self._controls.remove()
            self._controls = None
        if parent is None:
            return
        self._controls = self._server.scene.add_transform_controls(
            f"{parent}/gizmo",
            SIZE_M,
            disable_axes=not can_move,
            disable_sliders=not can_move,
            disable_rotations=not can_turn,
            depth_test=False,
        )

        # A coroutine, because the server runs others on several threads and out of order.
        async def changed(event: TransformControlsEvent) -> None:
            act = {"start": self._grab, "update": self._drag, "end": self._release}[event.phase]
            self._server.put(act, "drag" if event.phase == "update" else None)

        self._controls.on_update(changed)

    def _enter(self, position: tuple[float, float, float]) -> None:
        # A field that loses the focus sends its number again.
        if not np.array_equal(np.round(position, _DECIMALS), self._position):
            self.move(rigid(self._parent_T_part[:3, :3], np.array(position)))

    def _grab(self) -> None:
        self._continues = False

    def _release(self) -> None:
        self._continues = False
        if self._controls is not None:
            place(self._controls, self._parent_T_part)

    def _drag(self) -> None:
        if self._controls is None:
            return
        wxyz, position = np.array(self._controls.wxyz), np.array(self._controls.position)
        if wxyz.shape != (4,) or position.shape != (3,) or not np.isfinite([*wxyz, *position]).all() or not wxyz.any():
            return  # a page of ours never sends it
        pose = rigid(rotation_from_xyzw(np.roll(wxyz, -1)), position)
        if np.allclose(pose, self._parent_T_part, rtol=0.0, atol=_STILL):
            return
        self._is_dragged = True
        try:
            self.move(pose, continues=self._continues)
        finally:
            self._is_dragged = False
