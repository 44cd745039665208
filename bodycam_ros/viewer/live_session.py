"""The view of the running graph: the same scene, at the state that was published last."""

import time
from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Protocol

import numpy as np

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.static_cameras.limb_mesh import capsule_surfaces
from bodycam_ros.viewer.inbox import Inbox
from bodycam_ros.viewer.motion import Motion, in_order
from bodycam_ros.viewer.panels import add_switches
from bodycam_ros.viewer.scene import CAMERAS, MAP, NAMES, SURFACE, Scene
from bodycam_ros.viewer.server import LocalServer

_REPORT_S = 0.5
"""Between two counts of the states received."""

_SILENT_S = 2.0


@dataclass(frozen=True, eq=False)
class LiveState:
    """One published state.

    Attributes:
        body: as described last.
        stamp_ns: of the state [ns].
        angles: (A,) in the order of the body's ``JointAngles`` [rad], [m] of joints that slide.
        world_T_root: (4, 4) [m].
        poses: camera -> stamp [ns] -> world_T_camera (4, 4) [m] of its latest registrations.
    """

    body: BodyModel
    stamp_ns: int
    angles: Array
    world_T_root: Array
    poses: Mapping[str, Mapping[int, Array]]

    @property
    def motion(self) -> Motion:
        """The state as a motion of its body."""
        registered = {camera: in_order(poses) for camera, poses in self.poses.items()}
        names = JointAngles(self.body).names
        return Motion(np.array([self.stamp_ns]), self.world_T_root[None], names, self.angles[None], registered)


class Listener(Protocol):
    """Subscribes to the graph."""

    def stop(self) -> None:
        """End all subscriptions."""


MakeListener = Callable[[Callable[[BodyModel | str], None], Callable[[LiveState], None]], Listener]
"""Makes a listener that passes bodies, or a fault, to the first function and states to the second."""


def view_live(make_listener: MakeListener, map_path: Path | None, port: int) -> None:
    """Show the body of the running graph in a browser until the program is interrupted.

    Args:
        make_listener: subscribes to the graph.
        map_path: map folder; None: the body alone.
        port: of this machine; 0 takes any free one.

    Raises:
        BodycamError: the map is missing or damaged, or the port cannot be used.
    """
    reference_map = None if map_path is None else ReferenceMap.load(map_path)
    with ExitStack() as listening:

        def open_view(server: LocalServer) -> LiveSession:
            session = LiveSession(server, reference_map)
            listening.callback(make_listener(session.put_body, session.put_state).stop)
            return session

        LocalServer(port, "bodycam view: live").serve(open_view)


class LiveSession:
    """One view of the graph. ``put_body`` and ``put_state`` may be called on any thread, all else on one.

    Attributes:
        text: state of the graph, in words.
    """

    def __init__(self, server: LocalServer, reference_map: ReferenceMap | None) -> None:
        self._server, self._map = server, reference_map
        self._inbox = inbox = Inbox()
        self._body: BodyModel | None = None
        self._scene: Scene | None = None
        self._count, self._since, self._last = 0, time.monotonic(), float("-inf")
        self._is_framed = False
        self.text = "waiting for /robot_description: is the graph running, on the same ROS_DOMAIN_ID?"
        self._remark = server.gui.add_markdown(self.text)
        self._follow = server.gui.add_checkbox("follow the body", True)
        self._shown = {MAP: True} if reference_map is not None else {}
        self._shown |= {CAMERAS: True, SURFACE: True, NAMES: False}
        add_switches(server.gui, inbox, self._shown, self._switch, has_registrations=True)

    def put_body(self, body: BodyModel | str) -> None:
        """Show the body that the graph describes, or the reason why there is none."""
        self._inbox.put(lambda: self._take_body(body), "body")

    def put_state(self, state: LiveState) -> None:
        """Show a state of the graph; of several in the queue only the last."""
        self._count += 1
        self._inbox.put(lambda: self._show(state), "state")

    @property
    def unwritten(self) -> str:
        """Nothing: the body is the graph's."""
        return ""

    def step(self, timeout_s: float = _REPORT_S) -> None:
        """Do the next action, or wait for it up to a time."""
        action = self._inbox.take(timeout_s)
        if action is not None:
            action()
        now = time.monotonic()
        if now - self._since < _REPORT_S:
            return
        rate, self._count = self._count / (now - self._since), 0
        self._since = now
        if self._scene is not None:
            is_silent = now - self._last >= _SILENT_S
            self.text = "no state of the body is published" if is_silent else f"{rate:.0f} states a second"
        self._remark.content = self.text

    def _take_body(self, body: BodyModel | str) -> None:
        if isinstance(body, str):
            self.text = body
            return
        has_same_parts = self._body is not None and _parts(body) == _parts(self._body)
        self._body = body
        if has_same_parts and self._scene is not None:
            self._scene.reshape(body)
            return
        self._server.scene.reset()
        self._scene = Scene(
            self._server,
            body,
            self._map,
            Motion.standing(body),
            lambda part: None,
            read_surfaces=capsule_surfaces,
        )
        for layer, visible in self._shown.items():
            self._scene.show_layer(layer, visible)
        self._is_framed = False
        self.text = "waiting for /joint_states and /odometry"

    def _show(self, state: LiveState) -> None:
        if self._scene is None or state.body is not self._body:
            return
        self._last = time.monotonic()
        self._scene.motion = state.motion
        self._scene.show(0, follow=bool(self._follow.value))
        if not self._is_framed:
            self._scene.frame_body()
            self._is_framed = True

    def _switch(self, layer: str, visible: bool) -> None:
        self._shown[layer] = visible
        if self._scene is not None:
            self._scene.show_layer(layer, visible)


def _parts(body: BodyModel) -> tuple[object, ...]:
    """What a scene is built for; lengths and mounts can change later."""
    return body.segments, tuple((joint.name, joint.parent, joint.child) for joint in body.joints), tuple(body.mounts)
