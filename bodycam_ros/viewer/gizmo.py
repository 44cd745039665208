"""Arrows and arcs in the scene, by which a person moves and turns something."""

from collections.abc import Callable

import numpy as np
from viser import SceneApi, TransformControlsEvent, TransformControlsHandle

from bodycam_ros.geometry import Array, rigid, rotation_from_xyzw
from bodycam_ros.viewer.inbox import Inbox
from bodycam_ros.viewer.scene_nodes import place

SIZE_M = 0.22
"""Length of the arrows."""

_STILL = 1e-9  # [m], and of a rotation matrix: handles that were not moved


class Gizmo:
    """The handles of one thing at a time.

    Args:
        scene: that they are added to.
        inbox: that drags are put into.
        on_drag: called with the pose (4, 4) that they are dragged to [m], and whether that continues a drag; calls
            ``follow`` with the pose that the part then has.
    """

    def __init__(self, scene: SceneApi, inbox: Inbox, on_drag: Callable[[Array, bool], None]) -> None:
        self._scene, self._inbox, self._on_drag = scene, inbox, on_drag
        self._controls: TransformControlsHandle | None = None
        self._parent_T_part = np.eye(4)
        self._continues = self._is_dragged = False

    def detach(self) -> None:
        """Remove the handles."""
        if self._controls is not None:
            self._controls.remove()
            self._controls = None

    def attach(self, parent: str, parent_T_part: Array, *, can_move: bool = True, can_turn: bool = True) -> None:
        """Show handles at a pose (4, 4) in a node of the scene [m]: arrows if it can move, arcs if it can turn."""
        self.detach()
        controls = self._scene.add_transform_controls(
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

        controls.on_update(changed)
        self._controls = controls
        self.follow(parent_T_part)

    def follow(self, parent_T_part: Array) -> None:
        """Put the handles where the part is now; where a drag has taken it there, when they are released."""
        self._parent_T_part = parent_T_part
        if self._is_dragged:
            self._continues = True
        else:
            self._release()

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
            self._on_drag(pose, self._continues)
        finally:
            self._is_dragged = False
