"""The view of the running graph: the same scene, at the instant that was published last."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.body.urdf_reader import body_from_urdf
from bodycam_ros.errors import BodyError
from bodycam_ros.geometry import Array
from bodycam_ros.kinematics.joint_angles import JointAngles
from bodycam_ros.registration.reference_map import ReferenceMap
from bodycam_ros.static_cameras.limb_mesh import capsule_surfaces
from bodycam_ros.terminal import Terminal
from bodycam_ros.viewer.footage import FINE, Detail
from bodycam_ros.viewer.inbox import Inbox, on_input
from bodycam_ros.viewer.panels import ShowPanel
from bodycam_ros.viewer.scene import Scene
from bodycam_ros.viewer.sources import LocalServer
from bodycam_ros.viewer.timeline import Motion


@dataclass(frozen=True, eq=False)
class LiveInstant:
    """Where a body is.

    Attributes:
        stamp_ns: of the instant [ns].
        names: (A) of the joint angles.
        angles: (A) [rad], [m] of places.
        world_T_root: (4, 4) [m].
        poses: camera -> stamps [ns] and poses world_T_camera (4, 4) [m] that it found for itself lately, in order.
    """

    stamp_ns: int
    names: tuple[str, ...]
    angles: Array
    world_T_root: Array
    poses: Mapping[str, tuple[tuple[int, NDArray[np.float64]], ...]]

    def motion(self, body: BodyModel) -> Motion | None:
        """The instant as a motion of a body; None if it is of another one, or not finite."""
        column = {name: column for column, name in enumerate(self.names)}
        wanted = JointAngles(body).names
        if any(name not in column for name in wanted):
            return None
        angles = self.angles[[column[name] for name in wanted]]
        if not (np.isfinite(angles).all() and np.isfinite(self.world_T_root).all()):
            return None
        registered = {
            camera: (
                np.array([stamp for stamp, _ in heard], dtype=np.int64),
                np.array([pose for _, pose in heard], dtype=np.float64).reshape(-1, 4, 4),
            )
            for camera, heard in self.poses.items()
            if camera in body.mounts
        }
        stamps_ns = np.array([self.stamp_ns], dtype=np.int64)
        return Motion(stamps_ns, self.world_T_root[None], wanted, angles[None], registered)


class Listener(Protocol):
    """Hears the graph."""

    def watch(self, cameras: "tuple[str, ...]") -> None:
        """Hear from now on where these cameras find themselves."""

    def stop(self) -> None:
        """Hear no more."""


_TOLD_S = 0.5
"""Between two looks at how many instants came: what is shown of them is counted over so long."""

_SILENT_S = 2.0

MakeListener = Callable[[Callable[[str], None], Callable[[LiveInstant], None]], Listener]
"""Makes a listener of who is to be called with a URDF, and with an instant."""


def view_live(make_listener: MakeListener, map_path: Path | None, port: int, detail: Detail = FINE) -> None:
    """Show the body of the running graph in a browser until the program is interrupted.

    Args:
        make_listener: hears the graph.
        map_path: map folder; None: the body alone.
        port: of this machine; 0 takes any free one.
        detail: how finely it is drawn.

    Raises:
        BodycamError: the map is missing or damaged, or the port cannot be used.
    """
    reference_map = None if map_path is None else ReferenceMap.load(map_path)
    server = LocalServer(port, "bodycam view: live")
    try:
        session = LiveSession(server, reference_map, detail)
        listener = make_listener(session.hear_body, session.hear_instant)
        session.listener = listener
        try:
            Terminal().print(f"open {server.address}{detail.page} in a browser; Ctrl-C ends it", soft_wrap=True)
            while True:
                session.step(_TOLD_S)
        finally:
            listener.stop()
    finally:
        server.stop()


class LiveSession:
    """One view of the graph. ``hear_body`` and ``hear_instant`` may be called on any thread, all else on one.

    Attributes:
        listener: asked to hear the cameras of a body once there is one.
        state: what is said of the graph.
    """

    def __init__(self, server: LocalServer, reference_map: ReferenceMap | None, detail: Detail = FINE) -> None:
        self._server, self._map, self._detail = server, reference_map, detail
        self._inbox = Inbox()
        self._body: BodyModel | None = None
        self._scene: Scene | None = None
        self._shown = {"map": True, "cameras": True, "surface": True, "names": False}
        self._count, self._since, self._last = 0, time.monotonic(), float("-inf")
        self._is_framed = False
        self.listener: Listener | None = None
        self.state = "waiting for /robot_description: is the graph running, on the same ROS_DOMAIN_ID?"
        self._remark = server.gui.add_markdown(self.state)
        follow = server.gui.add_checkbox("follow the body", True)
        self._follows = True
        on_input(follow, lambda: self._inbox.put(lambda: setattr(self, "_follows", bool(follow.value))))
        switches = {name: partial(self._switch, name) for name in self._shown if name != "map" or reference_map}
        ShowPanel(server.gui, self._inbox, switches, {"names"}, knows_registration=True)

    def hear_body(self, urdf: str) -> None:
        """The graph describes a body."""
        self._inbox.put(lambda: self._take_body(urdf), "body")

    def hear_instant(self, instant: LiveInstant) -> None:
        """The graph says where it is; of several that wait the last is shown."""
        self._count += 1
        self._inbox.put(lambda: self._show(instant), "instant")

    def step(self, timeout_s: float) -> None:
        """Do what waits, or what comes within a time."""
        action = self._inbox.take(timeout_s)
        if action is not None:
            action()
        now = time.monotonic()
        if now - self._since >= _TOLD_S:
            rate, self._count = self._count / (now - self._since), 0
            self._since = now
            if self._scene is not None:
                silent = now - self._last
                self.state = f"{rate:.0f} instants a second" if silent < _SILENT_S else "nothing is heard of the body"
            if self._remark.content != self.state:
                self._remark.content = self.state

    def _take_body(self, urdf: str) -> None:
        try:
            body = body_from_urdf(urdf)
        except BodyError as error:
            self.state = f"/robot_description cannot be read: {error}"
            return
        is_same = self._body is not None and _outline(body) == _outline(self._body)
        self._body = body
        if is_same and self._scene is not None:
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
            detail=self._detail,
        )
        for name, visible in self._shown.items():
            self._switch(name, visible)
        self._is_framed = False
        self.state = "waiting for /joint_states and /odometry"
        if self.listener is not None:
            self.listener.watch(tuple(body.mounts))

    def _show(self, instant: LiveInstant) -> None:
        if self._scene is None or self._body is None:
            return
        motion = instant.motion(self._body)
        if motion is None:
            return
        self._last = time.monotonic()
        self._scene.move(motion)
        self._scene.show(self._body, 0, follow=self._follows)
        if not self._is_framed:
            self._scene.look_at_body(self._body, 0)
            self._is_framed = True

    def _switch(self, name: str, visible: bool) -> None:
        self._shown[name] = visible
        if self._scene is None or self._body is None:
            return
        if name == "surface":
            self._scene.show_surface(self._body, visible)
        else:
            {"map": self._scene.show_map, "cameras": self._scene.show_cameras, "names": self._scene.show_names}[name](
                visible
            )


def _outline(body: BodyModel) -> tuple[object, ...]:
    """What a scene is built for; the rest it can take over."""
    return body.segments, tuple((joint.name, joint.parent, joint.child) for joint in body.joints), tuple(body.mounts)
