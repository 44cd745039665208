"""What the middleware tells of a topic that is read: who cannot be read, what is late, who is gone, what is lost."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from rclpy.event_handler import SubscriptionEventCallbacks, UnsupportedEventTypeError
from rclpy.qos import QoSPolicyKind
from rclpy.subscription import Subscription

from bodycam_ros.nodes.flow_of_frames import Skipped


class TopicEvents:
    """Counts the events of a subscription, as what a node could not use, and says each kind once for each topic.

    Args:
        topic: full name.
        skipped: counts them.
        adapts: policies to which the reader adapts itself, so that a publisher that offers less is no fault.
    """

    def __init__(self, topic: str, skipped: Skipped, adapts: Sequence[QoSPolicyKind] = ()) -> None:
        self._topic, self._skipped, self._adapts = topic, skipped, adapts
        self._totals: dict[str, int] = {}

    def subscribed(self, subscribe: Callable[[SubscriptionEventCallbacks], Subscription]) -> Subscription:
        """A subscription with these events, without those that the middleware does not have."""
        self._totals.clear()
        strangers: dict[str, Any] = {
            "incompatible_qos": self._on_incompatible,
            "incompatible_type": partial(self._count, "publishers of another type", "is published as another type"),
        }
        delivery: dict[str, Any] = {
            "deadline": partial(self._count, "deadlines missed", "no message came within the deadline"),
            "message_lost": partial(self._count, "messages lost", "the middleware lost a message"),
            "liveliness": self._on_liveliness,
        }
        try:
            return subscribe(SubscriptionEventCallbacks(**strangers, **delivery))
        except UnsupportedEventTypeError:
            return subscribe(SubscriptionEventCallbacks(**strangers))

    def _count(self, kind: str, reason: str, event: Any) -> None:
        # Of the changes some middlewares say 0.
        fresh = event.total_count - self._totals.get(kind, 0)
        self._totals[kind] = event.total_count
        self._add(kind, reason, fresh)

    def _on_liveliness(self, event: Any) -> None:
        gone = event.not_alive_count - self._totals.get("gone", 0)
        self._totals["gone"] = event.not_alive_count
        self._add("publishers not alive", "who publishes it gives no sign of life", gone)

    def _add(self, kind: str, reason: str, count: int) -> None:
        for _ in range(count):
            self._skipped.add(f"{kind}, {self._topic}", f"{self._topic}: {reason}")

    def _on_incompatible(self, event: Any) -> None:
        if QoSPolicyKind(event.last_policy_kind) not in self._adapts:
            policy = QoSPolicyKind(event.last_policy_kind).name.lower()
            self._count(
                "publishers incompatible",
                f"a publisher offers less than this node asks for: {policy}; nothing is heard of it until one of both "
                f"changes (qos_overrides.{self._topic}.subscription.{policy})",
                event,
            )
