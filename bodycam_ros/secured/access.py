"""What one process says, hears, serves and asks, by ROS names, and what DDS calls that."""

from dataclasses import dataclass, fields
from typing import Self

DISCOVERY = "ros_discovery_info"
"""By this topic of DDS everybody in a ROS graph says which nodes he has; it is no topic of ROS."""


@dataclass(frozen=True)
class Access:
    """Names as ROS has them: ``/absolute``, ``relative`` to the namespace, ``~/private`` to the node.

    ``*`` stands for any letters, as in the permissions of DDS.

    Attributes:
        publishes: topics.
        subscribes: topics.
        serves: services that it answers.
        calls: services that it asks.
    """

    publishes: frozenset[str] = frozenset()
    subscribes: frozenset[str] = frozenset()
    serves: frozenset[str] = frozenset()
    calls: frozenset[str] = frozenset()

    @classmethod
    def of_action(cls, name: str) -> Self:
        """What executing an action takes."""
        services, topics = (("send_goal", "cancel_goal", "get_result"), ("feedback", "status"))
        return cls(
            publishes=frozenset(f"{name}/_action/{topic}" for topic in topics),
            serves=frozenset(f"{name}/_action/{service}" for service in services),
        )

    def __or__(self, other: Self) -> Self:
        both = {each.name: getattr(self, each.name) | getattr(other, each.name) for each in fields(self)}
        return type(self)(**both)

    def resolved(self, namespace: str, node: str) -> Self:
        """The same with absolute names.

        Args:
            namespace: of the node: "/" or "/alice".
            node: its name.
        """
        root = f"/{namespace.strip('/')}/".replace("//", "/")

        def absolute(name: str) -> str:
            if name.startswith("~"):
                return f"{root}{node}{name[1:]}"
            return name if name.startswith("/") else root + name

        return type(self)(**{each.name: frozenset(map(absolute, getattr(self, each.name))) for each in fields(self)})

    def written(self) -> list[str]:
        """Topics of DDS that it writes, of absolute names, in order: those of ROS, requests, answers."""
        topics = {f"rt{name}" for name in self.publishes} | {f"rq{name}Request" for name in self.calls}
        return sorted(topics | {f"rr{name}Reply" for name in self.serves} | {DISCOVERY})

    def read(self) -> list[str]:
        """Topics of DDS that it reads, of absolute names, in order."""
        topics = {f"rt{name}" for name in self.subscribes} | {f"rr{name}Reply" for name in self.calls}
        return sorted(topics | {f"rq{name}Request" for name in self.serves} | {DISCOVERY})
