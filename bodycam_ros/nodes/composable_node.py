"""A node that may share its process with others: what they say to each other does not go through the middleware."""

from collections.abc import Callable
from typing import Any, ClassVar

from rclpy.executors import Executor
from rclpy.node import Node
from rclpy.publisher import Publisher
from rclpy.serialization import deserialize_message, serialize_message
from rclpy.subscription import Subscription

from bodycam_ros.nodes.in_process import Arrivals, InProcessReader, InProcessTopics, InProcessWriter


class ComposableNode(Node):
    """All its publishers and subscriptions, rclpy's own for ``/clock`` included, take part in the process's topics.

    Services and actions do not: others call them, but no node of a process that is deaf to itself calls another's.
    """

    topics_within: ClassVar[InProcessTopics | None] = None
    """The topics of this process; None where the middleware carries everything, as in a process with one node."""

    def __init__(self, *arguments: Any, **options: Any) -> None:
        self.__arrivals = Arrivals()
        self.__readers: dict[Subscription, InProcessReader] = {}
        super().__init__(*arguments, **options)

    def create_publisher(self, *arguments: Any, publisher_class: type[Publisher] = Publisher, **options: Any) -> Any:
        """As rclpy does."""
        if self.topics_within is None or publisher_class is not Publisher:
            return super().create_publisher(*arguments, publisher_class=publisher_class, **options)
        publisher: Any = super().create_publisher(*arguments, publisher_class=ComposablePublisher, **options)
        publisher.join(self.topics_within)
        return publisher

    def create_subscription(
        self, msg_type: Any, topic: str, callback: Callable[[Any], None], *arguments: Any, **options: Any
    ) -> Subscription:
        """As rclpy does."""
        subscription = super().create_subscription(msg_type, topic, callback, *arguments, **options)
        if self.topics_within is not None:
            heard = (lambda message: callback(serialize_message(message))) if subscription.raw else callback
            reader = InProcessReader(subscription.topic_name, subscription.qos_profile, heard, self.__arrivals)
            self.__readers[subscription] = reader
            self.topics_within.add_reader(reader)
        return subscription

    def destroy_subscription(self, subscription: Subscription) -> bool:
        """As rclpy does."""
        reader = self.__readers.pop(subscription, None)
        if reader is not None and self.topics_within is not None:
            self.topics_within.remove_reader(reader)
        return bool(super().destroy_subscription(subscription))

    @property
    def executor(self) -> Executor | None:
        """What calls back."""
        executor: Executor | None = Node.executor.fget(self)  # type: ignore[attr-defined]  # a property of rclpy
        return executor

    @executor.setter
    def executor(self, executor: Executor) -> None:
        Node.executor.fset(self, executor)  # type: ignore[attr-defined]
        if executor is not None:
            self.__arrivals.begin(executor)


class ComposablePublisher(Publisher):
    """Its messages reach the readers of its own process as they are, and others through the middleware.

    The middleware gets only what somebody outside reads, and what is latched for who may come.
    """

    def join(self, topics: InProcessTopics) -> None:
        """Be heard within the process from now on; before anything is published."""
        self._topics = topics
        self._within = InProcessWriter(self.topic_name, self.qos_profile)
        topics.add_writer(self._within)

    def publish(self, msg: Any) -> None:
        """Publish a message, or a serialized one."""
        if self._within.is_latched or super().get_subscription_count():
            super().publish(msg)
        if isinstance(msg, bytes):
            if not (self._within.is_latched or self._within.readers):
                return
            msg = deserialize_message(msg, self.msg_type)
        self._topics.publish(self._within, msg)

    def get_subscription_count(self) -> int:
        """Subscriptions that hear it, of this process and of others."""
        return int(super().get_subscription_count()) + len(self._within.readers)

    def destroy(self) -> None:
        """Publish no more."""
        self._topics.remove_writer(self._within)
        super().destroy()
