"""Arrows and arcs in the scene, by which a person moves and turns something."""

from collections.abc import Callable

import numpy as np
from viser import SceneApi, TransformControlsEvent, TransformControlsHandle

from bodycam_ros.geometry import Array, rigid, rotation_from_xyzw
from bodycam_ros.viewer.scene_nodes import place

SIZE_M = 0.22
"""Length of the arrows."""


class Gizmo:
    """The handles of one thing at a time.

    Args:
        scene: that they are added to.
        on_grab: called when they are grabbed, and when they are released.
        on_move: called as they are dragged.
    """

    def __init__(self, scene: SceneApi, on_grab: Callable[[], None], on_move: Callable[[], None]) -> None:
        self._scene = scene
        self._on_grab = on_grab
        self._on_move = on_move
        self._controls: TransformControlsHandle | None = None

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
            (self._on_move if event.phase == "update" else self._on_grab)()

        controls.on_update(changed)
        self._controls = controls
        self.follow(parent_T_part)

    def follow(self, parent_T_part: Array) -> None:
        """Put the handles at another pose; not while they are dragged."""
        if self._controls is not None:
            place(self._controls, parent_T_part)

    @property
    def parent_T_part(self) -> Array:
        """(4, 4) where the handles are [m].

        Raises:
            ValueError: there are none.
        """
        if self._controls is None:
            raise ValueError("nothing is selected")
        return rigid(rotation_from_xyzw(np.roll(self._controls.wxyz, -1)), np.array(self._controls.position))
