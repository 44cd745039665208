"""Handles in the scene, and a panel of numbers, by which a person moves one part of a body or of a start at a time."""

from collections.abc import Callable, Sequence

import numpy as np
from viser import GuiFolderHandle, TransformControlsEvent, TransformControlsHandle, ViserServer

from bodycam_ros.geometry import Array, rigid, rotation_from_xyzw
from bodycam_ros.viewer.inbox import Action, Inbox, set_value
from bodycam_ros.viewer.scene import place

SIZE_M = 0.22
"""Length of the arrows."""

_STILL = 1e-9  # [m], and of a rotation matrix: handles that were not moved
_DECIMALS, _STEP_M = 4, 0.0001  # of the numbers


class Editor:
    """Shows and takes the pose of one chosen part.

    Args:
        server: whose page has the handles and the panel.
        inbox: that what a person does is put into.
        title, text: of the panel.
        parts: names to choose from.
        file_name: of what is written.
        select: called with the part that is chosen.
        move_to: called with the pose (4, 4) that the chosen part is to have [m], and whether that continues a drag;
            calls ``show`` with the pose that the part then has.
        undo, write: called by buttons.

    Attributes:
        folder: that the panel is in.
    """

    def __init__(
        self,
        server: ViserServer,
        inbox: Inbox,
        title: str,
        text: str,
        parts: Sequence[str],
        file_name: str,
        *,
        select: Callable[[str], None],
        move_to: Callable[[Array, bool], None],
        undo: Action,
        write: Action,
    ) -> None:
        self._scene, self._inbox, self._move_to = server.scene, inbox, move_to
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
            inbox.on_click(gui.add_button("Undo"), undo)
            self._write = gui.add_button(f"Write {file_name}")
            self._remark = gui.add_markdown("")
        inbox.on_input(self._part, select)
        inbox.on_input(self._place, lambda place: self._enter(np.array(place)))
        inbox.on_click(self._write, write)

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
        """Show a remark, and whether there is something to write."""
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
        self._controls = self._scene.add_transform_controls(
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
            self._inbox.put(act, "drag" if event.phase == "update" else None)

        self._controls.on_update(changed)

    def _enter(self, position: Array) -> None:
        # A field that loses the focus sends its number again.
        if not np.array_equal(np.round(position, _DECIMALS), self._position):
            self._move_to(rigid(self._parent_T_part[:3, :3], position), False)

    def _grab(self) -> None:
        self._continues = False

    def _release(self) -> None:
        self._continues = False
        if self._controls is not None:
            place(self._controls, self._parent_T_part)

    def _drag(self) -> None:
        if self._controls is None:
            return
        pose = rigid(rotation_from_xyzw(np.roll(self._controls.wxyz, -1)), np.array(self._controls.position))
        if np.allclose(pose, self._parent_T_part, rtol=0.0, atol=_STILL):
            return
        self._is_dragged = True
        try:
            self._move_to(pose, self._continues)
        finally:
            self._is_dragged = False
