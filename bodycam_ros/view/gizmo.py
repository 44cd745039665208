"""Handles in the scene by which a person moves the selected mount or joint."""

from collections.abc import Callable

import numpy as np
from viser import SceneApi, TransformControlsEvent, TransformControlsHandle

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array, rigid, rotation_from_xyzw
from bodycam_ros.view.correction import Part, can_turn, place_of
from bodycam_ros.view.scene_nodes import place, segment_name

SIZE_M = 0.22
"""Length of its arrows."""


class Gizmo:
    """Arrows and arcs at the selected part, in the axes of the segment that carries it."""

    def __init__(self, scene: SceneApi, on_grab: Callable[[], None], on_move: Callable[[], None]) -> None:
        self._scene = scene
        self._on_grab = on_grab
        self._on_move = on_move
        self._controls: TransformControlsHandle | None = None

    def select(self, body: BodyModel, part: Part | None) -> None:
        """Attach the handles to another part, or to none."""
        if self._controls is not None:
            self._controls.remove()
            self._controls = None
        if part is None:
            return
        segment, _ = place_of(body, part)
        controls = self._scene.add_transform_controls(
            f"{segment_name(segment)}/gizmo", SIZE_M, disable_rotations=not can_turn(body, part), depth_test=False
        )

        # A coroutine, because the server runs others on several threads and out of order.
        async def changed(event: TransformControlsEvent) -> None:
            (self._on_move if event.phase == "update" else self._on_grab)()

        controls.on_update(changed)
        self._controls = controls
        self.follow(body, part)

    def follow(self, body: BodyModel, part: Part) -> None:
        """Put the handles where the part is; not while a person holds them."""
        if self._controls is not None:
            place(self._controls, place_of(body, part)[1])

    @property
    def segment_T_part(self) -> Array:
        """(4, 4) where the handles are on the segment [m].

        Raises:
            ValueError: nothing is selected.
        """
        if self._controls is None:
            raise ValueError("nothing is selected")
        return rigid(rotation_from_xyzw(np.roll(self._controls.wxyz, -1)), np.array(self._controls.position))
