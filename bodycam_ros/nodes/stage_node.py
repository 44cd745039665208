"""A managed node, and the stage that it runs: created on configuration, destroyed on cleanup."""

import gc
import socket
import sys
import time
import traceback
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

from rclpy.clock import Clock, ClockType
from rclpy.event_handler import SubscriptionEventCallbacks
from rclpy.lifecycle import LifecycleNode, LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.qos_overriding_options import QoSOverridingOptions
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from bodycam_ros.diagnostics.dropped_messages import DroppedMessages
from bodycam_ros.errors import BodycamError
from bodycam_ros.graph.node_parameters import ManagedParameters
from bodycam_ros.messages.diagnostics import Status, StatusLevel, diagnostics_message
from bodycam_ros.messages.factory import Message, MessageFactory
from bodycam_ros.nodes.moments import Moments
from bodycam_ros.nodes.parameters import NodeParameters, message_class, node_messages, reliable
from bodycam_ros.nodes.process import spin
from bodycam_ros.pipeline.settings import PipelineSettings

P = TypeVar("P", bound=ManagedParameters)

_REPORT_S, _WATCH_S = 1.0, 0.5
_DIAGNOSTICS_DEPTH = 100
_STEADY = Clock(clock_type=ClockType.STEADY_TIME)


class Diagnostics:
    """Publishes the status of a node's parts on ``/diagnostics``, each under the node's full name."""

    def __init__(self, node: Node, make: MessageFactory) -> None:
        self._node, self._make = node, make
        kind = message_class("diagnostic_msgs/msg/DiagnosticArray")
        self._publisher = node.create_publisher(kind, "/diagnostics", reliable(_DIAGNOSTICS_DEPTH))

    def publish(self, parts: Sequence[Status]) -> None:
        """Publish the status of parts, by the node's clock, or by the time of day before there is /clock."""
        own, name = self._node.get_name(), self._node.get_fully_qualified_name().strip("/")
        named = [replace(part, name=name if part.name == own else f"{name}: {part.name}") for part in parts]
        now_ns = self._node.get_clock().now().nanoseconds or time.time_ns()
        self._publisher.publish(diagnostics_message(self._make, now_ns, named, socket.gethostname()))


def frame_prefix(node: Node, given: str) -> str:
    """Prefix of a node's frames: its parameter, or the node's namespace; ``/`` means none."""
    prefix = given or f"{node.get_namespace().strip('/')}/"
    return prefix.removeprefix("/")


class Stage(Generic[P]):
    """Work of a node while it is configured.

    Its topics, timers and services are made by the methods below, work while the node is active, and are destroyed with
    it. A BodycamError of a message drops that message, for nothing that is received may end a node; one of a timer ends
    the node's work.

    Args:
        node: runs the stage.

    Attributes:
        name, parameters_type, groups: of the node: its name unless it is remapped, its own parameters, its groups of
            settings.
        make: makes messages.
        dropped: counts messages that could not be used.
        moments: times at which frames arrived and left, if the parameter ``moments`` names a file.

    Raises:
        BodycamError: a file or a parameter is wrong.
    """

    name: ClassVar[str]
    parameters_type: ClassVar[type[Any]]
    groups: ClassVar[tuple[str, ...]] = ()

    def __init__(self, node: "StageNode[P]") -> None:
        self.node = node
        self.make = node.make
        self.moments = node.moments
        self.log, self.required = node.get_logger(), node.parameters.required
        self.dropped = DroppedMessages(self.log.warning)
        self._checks: list[Callable[[], None]] = []

    @classmethod
    def node_name(cls, words: Sequence[str]) -> str:
        """Name of the node, unless it is remapped, by the words of its command line."""
        return cls.name

    def activate(self) -> None:
        """The node becomes active."""

    def pause(self) -> None:
        """The node becomes inactive: publish what is due, and keep estimates."""

    def finish(self) -> None:
        """Last step before the stage is destroyed; publishing still works."""

    def settings_changed(self) -> None:
        """Parameters have changed."""

    def report(self) -> list[Status]:
        """Status of all parts since the last call; called once a second while the node is active."""
        return []

    @property
    def parameters(self) -> P:
        """The node's own parameters."""
        return self.node.parameters.own

    @property
    def settings(self) -> PipelineSettings:
        """Settings of all stages."""
        return self.node.parameters.settings

    def publisher(self, type_name: str, topic: str, quality: QoSProfile, overridable: bool = False) -> Any:
        """A publisher of a message type by its name; users can override its quality of service if it is overridable."""
        options = QoSOverridingOptions.with_default_policies() if overridable else None
        made = self.node.create_publisher(message_class(type_name), topic, quality, qos_overriding_options=options)
        self.node.made.callback(self.node.destroy_publisher, made)
        return made

    def subscription(
        self,
        type_name: str,
        topic: str,
        callback: Callable[[Any], object],
        quality: QoSProfile,
        convert: Callable[[Any], Any] | None = None,
        count: str = "",
        overridable: bool = False,
        even_inactive: bool = False,
        adapts: bool = False,
        raw: bool = False,
    ) -> Any:
        """A subscription; see ``guarded``.

        Args:
            type_name, topic, callback, quality: as of rclpy.
            convert: makes of each message what the callback takes; one for which it raises ValueError is dropped.
            count: name of the count of these ("tracks dropped").
            overridable: users can override its quality of service.
            even_inactive: as of ``guarded``.
            adapts: to its publishers, so that incompatible ones cause no warning.
            raw: messages are serialized.
        """

        def receive(message: Any) -> None:
            try:
                given = message if convert is None else convert(message)
            except ValueError as error:
                self.dropped.add(count, f"{topic}: malformed message ({error})")
                return
            try:
                callback(given)
            except BodycamError as error:
                self.dropped.add(count or "messages dropped", f"{topic}: {error}")

        options = QoSOverridingOptions.with_default_policies() if overridable else None
        events = SubscriptionEventCallbacks(use_default_callbacks=not adapts)
        made = self.node.create_subscription(
            message_class(type_name),
            topic,
            self.guarded(receive, even_inactive),
            quality,
            qos_overriding_options=options,
            event_callbacks=events,
            raw=raw,
        )
        self.node.made.callback(self.node.destroy_subscription, made)
        return made

    def every(self, seconds: float, callback: Callable[[], None], even_inactive: bool = False) -> Timer:
        """Call back regularly, in real time; see ``guarded``. The timer can be cancelled, and reset."""
        made = self.node.create_timer(seconds, self.guarded(callback, even_inactive), clock=_STEADY)
        self.node.made.callback(self.node.destroy_timer, made)
        return made

    def watch(self, check: Callable[[], None]) -> None:
        """Call back twice a second, while inactive too: all checks by one timer, of which EventsExecutor wants few."""
        if not self._checks:
            self.every(_WATCH_S, self._check, even_inactive=True)
        self._checks.append(check)

    def _check(self) -> None:
        for check in self._checks:
            check()

    def trigger(self, name: str, callback: Callable[[], str]) -> None:
        """A service ``std_srvs/Trigger``, which answers with what was done, or with the text of a BodycamError."""

        def answer(request: Message, response: Message) -> Message:
            try:
                response.success, response.message = True, callback()
            except BodycamError as error:
                response.success, response.message = False, str(error)
            return response

        self.node.made.callback(self.node.destroy_service, self.node.create_service(Trigger, name, answer))

    def call_later(self, callback: Callable[[], None], even_inactive: bool = False) -> None:
        """Call back once, after all messages that have arrived by now."""
        assert self.node.executor is not None
        self.node.executor.create_task(self.guarded(callback, even_inactive))

    def guarded(self, callback: Callable[..., None], even_inactive: bool = False) -> Callable[..., None]:
        """The callback; it does nothing after the stage is destroyed, or by default while inactive."""

        def guarded(*arguments: Any) -> None:
            node = self.node
            if node.stage is self and node.failure is None and (even_inactive or node.is_active):
                try:
                    callback(*arguments)
                except BodycamError as error:
                    node.fail(error)

        return guarded


class StageNode(LifecycleNode, Generic[P]):
    """A managed node that runs a stage.

    A BodycamError ends the process of a node with ``autostart``. A node that is managed becomes unconfigured, and so
    does any node whose configuration by hand fails: after the file is repaired it can be configured again.

    Args:
        stage_type: its stage.
        arguments: of this node alone, as on a command line ("--ros-args", "-r", ...), where others share the process.

    Attributes:
        parameters: its own, and the settings of its stage.
        make: makes messages.
        moments: times at which frames arrived and left.
        stage: while the node is configured.
        is_active: whether the stage works.
        failure: error that has ended the work.
        made: destroys the topics, timers and services of the stage.
    """

    def __init__(self, stage_type: type[Stage[P]], arguments: Sequence[str] = ()) -> None:
        super().__init__(
            stage_type.node_name([*arguments] or sys.argv),
            cli_args=[*arguments],
            automatically_declare_parameters_from_overrides=True,
            enable_logger_service=True,
        )
        self._stage_type = stage_type
        self.stage: Any = None
        self.is_active = False
        self.failure: BodycamError | None = None
        self._error_text, self._is_starting = "", False
        self.made = ExitStack()

    def bring_up(self) -> None:
        """Read the parameters, and with ``autostart`` configure and activate the node.

        Raises:
            BodycamError: a parameter is of the wrong type or out of its range, or the stage cannot start.
        """
        of = self._stage_type
        self.parameters: NodeParameters[P] = NodeParameters(self, of.parameters_type, of.groups)
        self.parameters.on_change = self._changed
        own = self.parameters.own
        self.make = node_messages(frame_prefix(self, own.frame_prefix))
        self.moments = Moments(Path(own.moments) if own.moments else None)
        self._diagnostics = Diagnostics(self, self.make)
        self.create_timer(_REPORT_S, self._report, clock=_STEADY)
        if not own.autostart:
            return
        self._is_starting = True
        for transition in (self.trigger_configure, self.trigger_activate):
            if transition() != TransitionCallbackReturn.SUCCESS:
                raise self.failure or BodycamError(self._error_text)
        self._is_starting = False

    def work(self, stopped: Callable[[], bool]) -> None:
        """Serve the stage until it fails, or is stopped; raises the BodycamError that ends a node by itself."""
        spin(self, lambda: stopped() or (self.failure is not None and self.parameters.own.autostart))
        if self.failure is not None:
            raise self.failure

    def finish(self) -> None:
        """Last step of the stage before the process ends."""
        if self.stage is not None:
            self.stage.finish()
        self.moments.write()

    def fail(self, error: BodycamError) -> None:
        """End the work with an error."""
        self.failure, self._error_text = error, str(error)
        if not self.parameters.own.autostart and self.executor is not None:
            # Later: the callback that failed is still running. A transition that fails leads to ``on_error``.
            self.executor.create_task(self.trigger_deactivate if self.is_active else self.trigger_cleanup)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Make the stage."""
        return self._step(self._configure)

    def on_activate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Start the stage."""
        return self._step(lambda: self.stage.activate(), is_active=True)

    def on_deactivate(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Pause the stage."""
        return self._step(lambda: self.stage.pause())

    def on_cleanup(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy the stage, unless its last step fails."""
        return self._step(self._cleanup)

    def on_shutdown(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Destroy the stage. The node stays, finalized, until its process ends."""
        self._step(self._cleanup)
        self._drop()
        return TransitionCallbackReturn.SUCCESS

    def on_error(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Become unconfigured."""
        self.is_active, self.failure = False, None
        self._drop()
        return TransitionCallbackReturn.SUCCESS

    def _configure(self) -> None:
        try:
            self.stage = self._stage_type(self)
        except BaseException:
            self._drop()
            raise
        self.parameters.is_configured = True

    def _cleanup(self) -> None:
        if self.stage is not None:
            self.stage.finish()
            self._drop()

    def _drop(self) -> None:
        self.stage = None
        self.parameters.is_configured = False
        self.made.close()
        if self.executor is not None:
            # A map is large, and subscriptions are in reference cycles.
            self.executor.create_task(gc.collect)

    def _step(self, step: Callable[[], object], is_active: bool = False) -> TransitionCallbackReturn:
        """A transition; its error is logged here, for rclpy drops it."""
        self.is_active = False
        if self.failure is not None:
            return TransitionCallbackReturn.ERROR
        try:
            step()
        except BodycamError as error:
            if self._is_starting:
                self.failure = error
            else:
                self.get_logger().error(str(error))
            self._error_text = str(error)
            return TransitionCallbackReturn.FAILURE
        except Exception:
            self._error_text = traceback.format_exc()
            self.get_logger().error(self._error_text)
            return TransitionCallbackReturn.ERROR
        self.is_active, self._error_text = is_active, ""
        return TransitionCallbackReturn.SUCCESS

    def _changed(self) -> None:
        if self.stage is not None:
            self.stage.settings_changed()

    def _report(self) -> None:
        if self.stage is not None and self.is_active:
            self._diagnostics.publish(self.stage.report())
            return
        level = StatusLevel.ERROR if self._error_text else StatusLevel.OK
        state = "inactive" if self.stage is not None else "unconfigured"
        self._diagnostics.publish(
            [Status(self.get_name(), level, f"{state}: {self._error_text}" if self._error_text else state)]
        )
