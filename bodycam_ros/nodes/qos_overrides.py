"""Which topics' quality of service a user may override (``qos_overrides.<topic>.<kind>.<policy>``), and within what."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Final

from rcl_interfaces.msg import SetParametersResult
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, LivelinessPolicy, QoSPolicyKind, QoSProfile, ReliabilityPolicy
from rclpy.qos_overriding_options import QoSOverridingOptions

from bodycam_ros.errors import SettingsError
from bodycam_ros.shown import shown

PREFIX: Final = "qos_overrides"

_WORDS: Final = {
    "reliability": ("reliable", "best_effort", "best_available", "system_default"),
    "durability": ("volatile", "transient_local", "best_available", "system_default"),
    "liveliness": ("automatic", "manual_by_topic", "system_default"),
    "history": ("keep_last", "keep_all", "system_default"),
}
_NUMBERS: Final = {
    "depth": (1, 10_000),
    "deadline": (0, 1 << 62),
    "lifespan": (0, 1 << 62),
    "liveliness_lease_duration": (0, 1 << 62),
}
"""Times are in nanoseconds; 0 is none."""

_KEPT: Final = "how many messages wait is fixed: without a bound a slow reader would fill the memory"


@dataclass(frozen=True)
class Overridable:
    """What of a topic may be overridden.

    Attributes:
        policies: that may be.
        why: the others may not.
        refuse: says what a quality of service would break; empty if nothing.
        reliability: in place of "best_available".
        durability: in place of "best_available".
    """

    policies: tuple[QoSPolicyKind, ...]
    why: str
    refuse: Callable[[QoSProfile], str] = lambda quality: ""
    reliability: ReliabilityPolicy = ReliabilityPolicy.RELIABLE
    durability: DurabilityPolicy = DurabilityPolicy.VOLATILE

    def resolved(self, reliability: ReliabilityPolicy, durability: DurabilityPolicy) -> "Overridable":
        """The same, with what is best available now."""
        return replace(self, reliability=reliability, durability=durability)

    def options(self, given: Mapping[str, Any], topic: str, kind: str) -> QoSOverridingOptions | None:
        """For rclpy, which declares the parameters.

        Args:
            given: what the user overrides, of all topics.
            topic: full name.
            kind: "publisher" or "subscription".

        Raises:
            SettingsError: a policy may not be overridden; later, when rclpy asks, a quality would break the graph.
        """
        start = f"{PREFIX}.{topic}.{kind}."
        allowed = [policy.name.lower() for policy in self.policies]
        for name in (name for name in given if name.startswith(start)):
            if name.removeprefix(start) not in allowed:
                but = f"; {', '.join(allowed)} may" if allowed else ""
                raise SettingsError(f"parameter {name}: may not be overridden, for {self.why}{but}")

        def judge(quality: QoSProfile) -> SetParametersResult:
            if reason := self.refuse(quality):
                raise SettingsError(f"parameters {start}*: {reason}")
            if quality.reliability == ReliabilityPolicy.BEST_AVAILABLE:
                quality.reliability = self.reliability
            if quality.durability == DurabilityPolicy.BEST_AVAILABLE:
                quality.durability = self.durability
            return SetParametersResult(successful=True)

        return QoSOverridingOptions(self.policies, callback=judge) if self.policies else None


def given_overrides(node: Node) -> dict[str, Any]:
    """What parameter files and the command line override, by name, whichever node's topics it is about.

    Args:
        node: made with ``automatically_declare_parameters_from_overrides``; afterwards it has none of these
            parameters any more, so that rclpy can declare them with their topics.

    Raises:
        SettingsError: a name or a value that cannot be.
    """
    prefixed: Mapping[str, Any] = node.get_parameters_by_prefix(PREFIX)  # rclpy annotates them as values
    given = {f"{PREFIX}.{name}": each.value for name, each in prefixed.items()}
    for name, value in given.items():
        _check(name, value)
        node.undeclare_parameter(name)
    return given


def overridden(given: Mapping[str, Any], topic: str, kind: str, policy: str) -> str:
    """The word that a user has for a policy; empty if that is left to us."""
    word = str(given.get(f"{PREFIX}.{topic}.{kind}.{policy}", ""))
    return "" if word == "best_available" else word


def _check(name: str, value: Any) -> None:
    topic, _, rest = name.removeprefix(f"{PREFIX}.").partition(".")
    kind, _, policy = rest.partition(".")
    if not topic.startswith("/") or kind not in ("publisher", "subscription"):
        raise SettingsError(
            f"parameter {name}: expected {PREFIX}./TOPIC.publisher.POLICY or .subscription., with the topic's full name"
        )
    if policy in _WORDS:
        if value not in _WORDS[policy]:
            raise SettingsError(f"parameter {name}: must be {' or '.join(_WORDS[policy])}, not {shown(value)}")
    elif policy in _NUMBERS:
        low, high = _NUMBERS[policy]
        if not isinstance(value, int) or isinstance(value, bool) or not low <= value <= high:
            unit = "" if policy == "depth" else " of nanoseconds"
            raise SettingsError(f"parameter {name}: must be a whole number{unit}, {low} or more, not {shown(value)}")
    else:
        known = ", ".join(sorted((*_WORDS, *_NUMBERS)))
        raise SettingsError(f"parameter {name}: there is no policy {shown(policy)}; known are {known}")


def _of_transforms(quality: QoSProfile) -> str:
    if quality.reliability == ReliabilityPolicy.BEST_EFFORT:
        return "tf2's listeners ask for reliable delivery and would hear no transform of a publisher of best effort"
    return _of_publisher(quality)


def _of_latched(quality: QoSProfile) -> str:
    if (quality.reliability, quality.durability) != (ReliabilityPolicy.RELIABLE, DurabilityPolicy.TRANSIENT_LOCAL):
        return "it is said once; who starts later, or loses it, hears it only if it is reliable and transient_local"
    return _of_publisher(quality)


def _of_publisher(quality: QoSProfile) -> str:
    if quality.liveliness == LivelinessPolicy.MANUAL_BY_TOPIC:
        return "liveliness manual_by_topic: nobody asserts it here between two messages; automatic does it by itself"
    return ""


_WATCHED = (QoSPolicyKind.DEADLINE, QoSPolicyKind.LIVELINESS, QoSPolicyKind.LIVELINESS_LEASE_DURATION)
_SENT = (QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY, QoSPolicyKind.DEPTH, QoSPolicyKind.LIFESPAN, *_WATCHED)

FIXED: Final = Overridable((), "the stages count on every message: one that is lost between them is lost for good")
IMAGES_HEARD: Final = Overridable(
    (QoSPolicyKind.RELIABILITY, *_WATCHED), "the parameter 'image_queue' says how many images may wait"
)
INFOS_HEARD: Final = Overridable((QoSPolicyKind.RELIABILITY, QoSPolicyKind.DURABILITY, *_WATCHED), _KEPT)
MOTION_HEARD: Final = Overridable((QoSPolicyKind.RELIABILITY, *_WATCHED), _KEPT)
MOTION_SAID: Final = Overridable(_SENT, _KEPT, _of_publisher)
TRANSFORMS_SAID: Final = Overridable(_SENT, _KEPT, _of_transforms)
LATCHED_SAID: Final = Overridable(_SENT, _KEPT, _of_latched)
