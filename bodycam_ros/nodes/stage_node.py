"""What every node of the graph has: checked parameters, guarded callbacks, health reports."""

from collections.abc import Callable, Sequence
from typing import Any, ClassVar, Generic, TypeVar

import rclpy
from rclpy.executors import Executor, SingleThreadedExecutor
from rclpy.node import Node
from rclpy.qos import QoSProfile
from rclpy.subscription import Subscription

from bodycam_ros.calibration.calibration_settings import CalibrationSettings
from bodycam_ros.errors import BodycamError, SettingsError
from bodycam_ros.messages.status import Health, diagnostics_message
from bodycam_ros.nodes.flow_of_frames import Skipped
from bodycam_ros.nodes.message_classes import message_class, node_messages
from bodycam_ros.nodes.parameters import declare, given_parameters, own_parameters, settings_from_parameters
from bodycam_ros.nodes.qos import reliable

P = TypeVar("P")

_SPIN_S = 0.2
_REPORT_NS = 1_000_000_000
_JUMP_NS = 10 * _REPORT_NS
"""Stamps so far behind are no late camera: the recording has started again."""
_DIAGNOSTICS_DEPTH = 100


class StageNode(Node, Generic[P]):
    """A node with the settings of some stages.

    Args:
        name: of the node, unless it is remapped.
        parameters_type: dataclass of its own parameters.
        groups: the groups of settings that it uses; a parameter file may hold others too.

    Attributes:
        parameters: its own parameters.
        settings: of all stages.
        calibration_settings: of the calibration of a body.
        make: makes messages.
        skipped: what could not be used, warned about once and counted.
        failure: the user's error that ends the node.

    Raises:
        SettingsError: a parameter is unknown, of the wrong type, or out of its range.
    """

    made: ClassVar[list[Node]] = []
    """The nodes of this process. One whose start was refused is in ROS as well, and has to leave it."""

    def __init__(self, name: str, parameters_type: type[P], groups: Sequence[str] = ()) -> None:
        super().__init__(name, automatically_declare_parameters_from_overrides=True)
        self.made.append(self)
        given = given_parameters(self)
        self.parameters = own_parameters(given, parameters_type)
        self.settings, self.calibration_settings = settings_from_parameters(given)
        declare(self, self.parameters)
        for group in groups:
            of = self.calibration_settings if group in CalibrationSettings.groups() else self.settings
            declare(self, getattr(of, group), group)
        self.make = node_messages()
        self.skipped = Skipped(self.get_logger().warning)
        self.failure: BodycamError | None = None
        self._diagnostics = self.publisher(
            "diagnostic_msgs/msg/DiagnosticArray", "/diagnostics", reliable(_DIAGNOSTICS_DEPTH)
        )
        self._report_due_ns = 0

    def publisher(self, type_name: str, topic: str, quality: QoSProfile) -> Any:
        """A publisher of a message type by name."""
        return self.create_publisher(message_class(type_name), topic, quality)

    def subscription(
        self, type_name: str, topic: str, callback: Callable[[Any], None], quality: QoSProfile
    ) -> Subscription:
        """A subscription; its callback is guarded."""
        return self.create_subscription(message_class(type_name), topic, self.guarded(callback), quality)

    def every(self, seconds: float, callback: Callable[[], None]) -> None:
        """Call back again and again in wall time, guarded."""
        self.create_timer(seconds, self.guarded(callback))

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

    def report_when_due(self, stamp_ns: int, health: Callable[[], list[Health]]) -> None:
        """Publish the health if the stamps are a second further than at the last report, or far behind it."""
        if not self._report_due_ns - _JUMP_NS <= stamp_ns < self._report_due_ns:
            self.report(stamp_ns, health())

    def report(self, stamp_ns: int, health: list[Health]) -> None:
        """Publish the health now."""
        self._report_due_ns = stamp_ns + _REPORT_NS
        self._diagnostics.publish(diagnostics_message(self.make, stamp_ns, health))

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
