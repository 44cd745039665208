"""What every node of the graph has: checked parameters, guarded callbacks, health reports."""

import socket
from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import rclpy
from rcl_interfaces.msg import SetParametersResult
from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.lifecycle import LifecycleState, TransitionCallbackReturn
from rclpy.node import Node
from rclpy.parameter import Parameter
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.timer import Timer
from std_srvs.srv import Trigger

from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.errors import BodycamError, SettingsError
from bodycam_ros.messages.factory import Message
from bodycam_ros.messages.status import Health, HealthLevel, diagnostics_message
from bodycam_ros.moments import Moments
from bodycam_ros.nodes.common_parameters import CommonParameters, ManagedParameters
from bodycam_ros.nodes.composable_node import ComposableNode
from bodycam_ros.nodes.flow_of_frames import Skipped
from bodycam_ros.nodes.live_parameters import NodeSettings, change, refused
from bodycam_ros.nodes.managed_node import ManagedNode
from bodycam_ros.nodes.message_classes import message_class, node_messages
from bodycam_ros.nodes.parameters import (
    declare,
    given_parameters,
    own_parameters,
    settings_from_parameters,
)
from bodycam_ros.nodes.qos import reliable
from bodycam_ros.nodes.qos_overrides import FIXED, Overridable, given_overrides
from bodycam_ros.nodes.topic_events import TopicEvents

P = TypeVar("P", bound=CommonParameters)

_SPIN_S = 0.2
_REPORT_S = 1.0
_CLOCKLESS_REPORTS = 2
"""A simulation's clock may be some seconds late."""
_DIAGNOSTICS_DEPTH = 100


class StageNode(ComposableNode, ManagedNode, Generic[P]):
    """A node with the settings of some stages.

    Args:
        name: of the node, unless it is remapped.
        parameters_type: dataclass of its own parameters.
        groups: the groups of settings that it uses; a parameter file may hold others too.
        arguments: of this node alone, as on a command line ("--ros-args", "-r", ...), where others share the process.

    Attributes:
        overrides: what they say of the quality of service of topics, by name.
        given: what parameter files and the command line say of the rest, by name.
        parameters: its own parameters.
        settings: of all stages.
        calibration_settings: of the calibration of a body.
        make: makes messages.
        skipped: what could not be used since the node was configured, warned about once and counted.
        moments: when frames came and went, if the parameter ``moments`` asks for that.

    Raises:
        SettingsError: a parameter is unknown, of the wrong type, or out of its range.
    """

    made: ClassVar[list[Node]] = []
    """The nodes of this process. One whose start was refused is in ROS as well, and has to leave it."""

    def __init__(
        self, name: str, parameters_type: type[P], groups: Sequence[str] = (), arguments: Sequence[str] = ()
    ) -> None:
        super().__init__(name, arguments)
        self.made.append(self)
        self.overrides = given_overrides(self)
        self.given = given_parameters(self)
        self.parameters = own_parameters(self.given, parameters_type)
        self.settings, self.calibration_settings = settings_from_parameters(self.given)
        declare(self, self.parameters)
        for group in groups:
            of = self.calibration_settings if group in CalibrationSettings.groups() else self.settings
            declare(self, getattr(of, group), group)
        self.autostart = not isinstance(self.parameters, ManagedParameters) or self.parameters.autostart
        self.make = node_messages(self.parameters.frame_prefix)
        self.skipped = Skipped(self.get_logger().warning)
        self.moments = Moments(Path(self.parameters.moments) if self.parameters.moments else None)
        self._diagnostics = self.publisher(
            "diagnostic_msgs/msg/DiagnosticArray", "/diagnostics", reliable(_DIAGNOSTICS_DEPTH)
        )
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._clockless = 0
        self.every(_REPORT_S, self._report_health, even_inactive=True)

    def on_configure(self, state: LifecycleState) -> TransitionCallbackReturn:
        """Count anew what cannot be used."""
        self.skipped = Skipped(self.get_logger().warning)
        return super().on_configure(state)

    def set_parameters_atomically(self, parameter_list: list[Parameter]) -> SetParametersResult:
        """Change what may change now, checked as in a file; refuse the rest, and say why."""
        before = NodeSettings(self.parameters, self.settings, self.calibration_settings)
        try:
            after, to_set = change(self, before, parameter_list, self._is_configured)
        except SettingsError as error:
            return refused(error)
        result = super().set_parameters_atomically(to_set)
        if result.successful:
            self.parameters, self.settings, self.calibration_settings = after.own, after.pipeline, after.calibration
            if self._is_configured:
                self.settings_changed()
        return result

    def settings_changed(self) -> None:
        """Hand on what has changed to those who have settings of their own."""

    def publisher(self, type_name: str, topic: str, quality: QoSProfile, may: Overridable = FIXED) -> Any:
        """A publisher of a message type by name, and what of its quality a user may override."""
        options = may.options(self.overrides, self.resolve_topic_name(topic), "publisher")
        return self.create_publisher(message_class(type_name), topic, quality, qos_overriding_options=options)

    def subscription(
        self,
        type_name: str,
        topic: str,
        callback: Callable[[Any], None],
        quality: QoSProfile,
        may: Overridable = FIXED,
        events: TopicEvents | None = None,
        even_inactive: bool = False,
    ) -> Subscription:
        """A subscription; its callback is guarded, what the middleware tells of it is counted."""
        subscribe = partial(
            self.create_subscription,
            message_class(type_name),
            topic,
            self.guarded(callback, even_inactive),
            quality,
            qos_overriding_options=may.options(self.overrides, self.resolve_topic_name(topic), "subscription"),
        )
        return events.subscribed(lambda callbacks: subscribe(event_callbacks=callbacks)) if events else subscribe()

    def every(self, seconds: float, callback: Callable[[], None], even_inactive: bool = False) -> Timer:
        """Call back again and again, guarded; in real time, whatever clock the node is given."""
        return self.create_timer(seconds, self.guarded(callback, even_inactive), clock=self._steady)

    def soon(self, callback: Callable[[], None], even_inactive: bool = False) -> None:
        """Call back once, guarded, after what has arrived by now is served."""
        assert self.executor is not None
        self.executor.create_task(self.guarded(callback, even_inactive))

    def trigger(self, name: str, callback: Callable[[], tuple[bool, str]]) -> None:
        """Serve a ``std_srvs/Trigger``; the callback says whether it was done, and what.

        Whoever asks hears of a BodycamError, and the node goes on.
        """

        def answer(request: Message, response: Message) -> Message:
            try:
                response.success, response.message = callback()
            except BodycamError as error:
                response.success, response.message = False, str(error)
            return response

        self.create_service(Trigger, name, answer)

    def required(self, name: str) -> str:
        """The value of a parameter that has no default.

        Raises:
            SettingsError: it is empty.
        """
        value: str = getattr(self.parameters, name)
        if not value:
            text = self.describe_parameter(name).description
            raise SettingsError(f"the parameter '{name}' is missing ({text}); give it with --ros-args -p {name}:=...")
        return value

    def health(self) -> list[Health]:
        """How the node fares since the last call of this; for ``/diagnostics``, once a second."""
        return []

    def report(self, stamp_ns: int, health: Sequence[Health]) -> None:
        """Publish health now, under the node's name, and its namespace's: all that run speak on one topic."""
        name = self.get_fully_qualified_name().strip("/")
        own = self.get_name()
        named = [replace(part, name=name if part.name == own else f"{name}: {part.name}") for part in health]
        self._diagnostics.publish(diagnostics_message(self.make, stamp_ns, named, socket.gethostname()))

    def _report_health(self) -> None:
        parts = self.health() if self.is_active else [self._rest()]
        now_ns = self.get_clock().now().nanoseconds
        if now_ns == 0:
            now_ns = Clock(clock_type=ClockType.SYSTEM_TIME).now().nanoseconds
            parts += self._missing_clock()
        if parts:
            self.report(now_ns, parts)

    def _rest(self) -> Health:
        """The node is not at work, and why."""
        if self.why is None:
            return Health(self.get_name(), HealthLevel.OK, self.state)
        return Health(self.get_name(), HealthLevel.ERROR, f"{self.state}: {self.why}")

    def _missing_clock(self) -> list[Health]:
        """The node is to follow a simulation's clock, which is not there."""
        self._clockless += 1
        if self._clockless < _CLOCKLESS_REPORTS:
            return []
        text = "use_sim_time is set, but nobody publishes /clock"
        if self._clockless == _CLOCKLESS_REPORTS:
            self.get_logger().warning(f"{text}; nothing waits for it, but the stamps of /diagnostics are not its own")
        return [Health("clock", HealthLevel.WARN, text)]

    def work(self, stopped: Callable[[], bool]) -> None:
        """Serve the subscriptions until the node fails, is shut down, or is stopped."""
        executor = light_executor()
        executor.add_node(self)
        never = rclpy.task.Future()
        # In slices: Python hears of signals between them, and without a time limit rclpy 7.1.6's EventsExecutor hangs.
        while not self.is_over and not stopped():
            executor.spin_until_future_complete(never, _SPIN_S)
        executor.remove_node(self)


def light_executor() -> Executor:
    """The executor that takes half the time per message, where this rclpy has it."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()
