"""What every node of the graph has: checked parameters, guarded callbacks, health reports."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, ClassVar, Generic, TypeVar

import rclpy
from rclpy.clock import Clock, ClockType
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription
from rclpy.timer import Timer

from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.errors import BodycamError, SettingsError
from bodycam_ros.messages.status import Health, HealthLevel, diagnostics_message
from bodycam_ros.moments import Moments
from bodycam_ros.nodes.common_parameters import CommonParameters
from bodycam_ros.nodes.flow_of_frames import Skipped
from bodycam_ros.nodes.message_classes import message_class, node_messages
from bodycam_ros.nodes.parameters import (
    declare,
    given_parameters,
    own_parameters,
    settings_from_parameters,
)
from bodycam_ros.nodes.qos import reliable

P = TypeVar("P", bound=CommonParameters)

_SPIN_S = 0.2
_REPORT_S = 1.0
_CLOCKLESS_REPORTS = 2
"""A simulation's clock may be some seconds late."""
_DIAGNOSTICS_DEPTH = 100


class StageNode(Node, Generic[P]):
    """A node with the settings of some stages.

    Args:
        name: of the node, unless it is remapped.
        parameters_type: dataclass of its own parameters.
        groups: the groups of settings that it uses; a parameter file may hold others too.

    Attributes:
        given: what parameter files and the command line say, by name.
        parameters: its own parameters.
        settings: of all stages.
        calibration_settings: of the calibration of a body.
        make: makes messages.
        skipped: what could not be used, warned about once and counted.
        moments: when frames came and went, if the parameter ``moments`` asks for that.
        failure: the user's error that ends the node.

    Raises:
        SettingsError: a parameter is unknown, of the wrong type, or out of its range.
    """

    made: ClassVar[list[Node]] = []
    """The nodes of this process. One whose start was refused is in ROS as well, and has to leave it."""

    def __init__(self, name: str, parameters_type: type[P], groups: Sequence[str] = ()) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True)
        self.made.append(self)
        self.given = given_parameters(self)
        self.parameters = own_parameters(self.given, parameters_type)
        self.settings, self.calibration_settings = settings_from_parameters(self.given)
        declare(self, self.parameters)
        for group in groups:
            of = self.calibration_settings if group in CalibrationSettings.groups() else self.settings
            declare(self, getattr(of, group), group)
        self.make = node_messages()
        self.skipped = Skipped(self.get_logger().warning)
        self.moments = Moments(Path(self.parameters.moments) if self.parameters.moments else None)
        self.failure: BodycamError | None = None
        self._diagnostics = self.publisher(
            "diagnostic_msgs/msg/DiagnosticArray", "/diagnostics", reliable(_DIAGNOSTICS_DEPTH)
        )
        self._steady = Clock(clock_type=ClockType.STEADY_TIME)
        self._clockless = 0
        self.every(_REPORT_S, self._report_health)

    def publisher(self, type_name: str, topic: str, quality: QoSProfile) -> Any:
        """A publisher of a message type by name."""
        return self.create_publisher(message_class(type_name), topic, quality)

    def subscription(
        self, type_name: str, topic: str, callback: Callable[[Any], None], quality: QoSProfile
    ) -> Subscription:
        """A subscription; its callback is guarded."""
        return self.create_subscription(message_class(type_name), topic, self.guarded(callback), quality)

    def every(self, seconds: float, callback: Callable[[], None]) -> Timer:
        """Call back again and again, guarded; in real time, whatever clock the node is given."""
        return self.create_timer(seconds, self.guarded(callback), clock=self._steady)

    def soon(self, callback: Callable[[], None]) -> None:
        """Call back once, guarded, after what has arrived by now is served."""
        self.executor.create_task(self.guarded(callback))

    def guarded(self, callback: Callable[..., None]) -> Callable[..., None]:
        """The callback, except that a BodycamError ends the node."""

        def guarded(*arguments: Any) -> None:
            if self.failure is None:
                try:
                    callback(*arguments)
                except BodycamError as error:
                    self.failure = error

        return guarded

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
        """Publish health now, under the node's name."""
        name = self.get_name()
        named = [part if part.name == name else replace(part, name=f"{name}: {part.name}") for part in health]
        self._diagnostics.publish(diagnostics_message(self.make, stamp_ns, named))

    def _report_health(self) -> None:
        parts = self.health()
        now_ns = self.get_clock().now().nanoseconds
        if now_ns == 0:
            now_ns = Clock(clock_type=ClockType.SYSTEM_TIME).now().nanoseconds
            parts += self._missing_clock()
        if parts:
            self.report(now_ns, parts)

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
        """Serve the subscriptions until the node fails or is stopped."""
        executor = _executor()
        executor.add_node(self)
        never = rclpy.task.Future()
        # In slices: Python hears of signals between them, and without a time limit rclpy 7.1.6's EventsExecutor hangs.
        while self.failure is None and not stopped():
            executor.spin_until_future_complete(never, _SPIN_S)
        executor.remove_node(self)

    def finish(self) -> None:
        """Last words before the node goes; publishing still works."""


def _executor() -> Executor:
    """The executor that takes half the time per message, where this rclpy has it."""
    try:
        from rclpy.experimental import EventsExecutor
    except ImportError:
        return SingleThreadedExecutor()
    return EventsExecutor()
