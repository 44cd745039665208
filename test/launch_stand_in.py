"""As much of launch and launch_ros as the launch file uses: they have no wheels, so a test has to perform it itself.

The stand-ins take the arguments that Jazzy's take and no others, and refuse the values that Jazzy's refuse.
"""

import os
import re
import runpy
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from types import ModuleType
from typing import Any
from unittest.mock import patch

import yaml


class LaunchContext:
    def __init__(self, arguments: Mapping[str, str]) -> None:
        self.launch_configurations = dict(arguments)
        self.environment = dict(os.environ)


class LaunchConfiguration:
    def __init__(self, variable_name: str) -> None:
        self.variable_name = variable_name

    def perform(self, context: LaunchContext) -> str:
        return context.launch_configurations[self.variable_name]


class EnvironmentVariable:
    def __init__(self, name: str, *, default_value: str | None = None) -> None:
        assert default_value is None or isinstance(default_value, str)
        self.name, self.default_value = name, default_value

    def perform(self, context: LaunchContext) -> str:
        value = context.environment.get(self.name, self.default_value)
        assert value is not None, f"environment variable {self.name} is not set"
        return value


class LaunchDescriptionEntity:
    def execute(self, context: LaunchContext) -> "Iterable[LaunchDescriptionEntity]":
        return ()


class DeclareLaunchArgument(LaunchDescriptionEntity):
    def __init__(
        self,
        name: str,
        *,
        default_value: str | None = None,
        description: str | None = None,
        choices: Iterable[str] | None = None,
    ) -> None:
        self.name, self.default_value, self.description = name, default_value, description
        self.choices = None if choices is None else list(choices)
        assert default_value is None or isinstance(default_value, str), f"{name}: a default is text"
        assert description, f"{name}: without a description nobody knows what it is for"
        assert self.choices is None or default_value is None or default_value in self.choices, name

    def execute(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity]:
        if self.name not in context.launch_configurations:
            if self.default_value is None:
                raise RuntimeError(f"Included launch description missing required argument '{self.name}'")
            context.launch_configurations[self.name] = self.default_value
        value = context.launch_configurations[self.name]
        if self.choices is not None and value not in self.choices:
            raise RuntimeError(f"Argument '{self.name}' provided value '{value}' is not valid")
        return ()


class SetEnvironmentVariable(LaunchDescriptionEntity):
    def __init__(self, name: str, value: EnvironmentVariable) -> None:
        self.name, self.value = name, value

    def execute(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity]:
        context.environment[self.name] = self.value.perform(context)
        return ()


class OpaqueFunction(LaunchDescriptionEntity):
    def __init__(self, *, function: Callable[[LaunchContext], list[LaunchDescriptionEntity] | None]) -> None:
        self.function = function

    def execute(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity]:
        return self.function(context) or ()


class LaunchDescription:
    def __init__(self, initial_entities: Iterable[LaunchDescriptionEntity]) -> None:
        self.entities = list(initial_entities)


class Node(LaunchDescriptionEntity):
    """A node's process; ``command_arguments`` are those that launch_ros would give it."""

    def __init__(
        self,
        *,
        package: str,
        executable: str,
        name: str,
        parameters: Sequence[str | Path | Mapping[str, Any]],
        output: str,
        respawn: bool,
        respawn_delay: float,
        sigterm_timeout: str,
        sigkill_timeout: str,
    ) -> None:
        assert re.fullmatch(r"[A-Za-z_]\w*", name), f"{name} is no name for a node"
        assert isinstance(respawn, bool) and isinstance(respawn_delay, float) and output == "screen"
        assert all(isinstance(text, str) and float(text) > 0.0 for text in (sigterm_timeout, sigkill_timeout))
        self.package, self.executable, self.name = package, executable, name
        self.respawn, self.respawn_delay = respawn, respawn_delay
        self.leave_s = float(sigterm_timeout) + float(sigkill_timeout)
        self.files = [Path(part) for part in parameters if not isinstance(part, Mapping)]
        self.parameters: dict[str, Any] = {}
        for part in parameters:
            if isinstance(part, Mapping):
                self.parameters |= {key: _allowed(key, value) for key, value in part.items()}

    def command_arguments(self, folder: Path) -> list[str]:
        """Parameters given in the launch file travel in a file of their own, which is written to ``folder``."""
        given = folder / f"{self.name}.params.yaml"
        given.write_text(yaml.safe_dump({"/**": {"ros__parameters": self.parameters}}))
        files = [part for path in [*self.files, given] for part in ("--params-file", str(path))]
        return ["--ros-args", "-r", f"__node:={self.name}", *files]


def _allowed(name: str, value: Any) -> Any:
    if isinstance(value, (list, tuple)):
        assert value and len({type(each) for each in value}) == 1, f"{name}: launch takes no empty or mixed lists"
        assert isinstance(value[0], (bool, int, float, str)), name
        return list(value)
    assert isinstance(value, (bool, int, float, str)), f"{name}: launch takes no {type(value).__name__}"
    return value


def performed(launch_file: Path, share: Path, **arguments: str) -> tuple[list[Node], LaunchContext]:
    """The nodes that ``ros2 launch <file> <arguments>`` starts, and the context that they are started in.

    Args:
        launch_file: the launch file.
        share: what is the package's share folder in it.
        arguments: of the launch file.

    Raises:
        RuntimeError: an argument is missing or none of its choices.
    """
    modules = {
        "launch": [LaunchContext, LaunchDescription, LaunchDescriptionEntity],
        "launch.actions": [DeclareLaunchArgument, OpaqueFunction, SetEnvironmentVariable],
        "launch.substitutions": [EnvironmentVariable, LaunchConfiguration],
        "launch_ros": [],
        "launch_ros.actions": [Node],
        "ament_index_python": [],
        "ament_index_python.packages": [],
    }
    standing_in = {name: ModuleType(name) for name in modules}
    for name, classes in modules.items():
        vars(standing_in[name]).update({each.__name__: each for each in classes})
    vars(standing_in["ament_index_python.packages"])["get_package_share_directory"] = lambda package: str(share)
    context = LaunchContext(arguments)
    nodes: list[Node] = []
    with patch.dict(sys.modules, standing_in):
        waiting = list(runpy.run_path(str(launch_file))["generate_launch_description"]().entities)
        while waiting:
            entity = waiting.pop(0)
            if isinstance(entity, Node):
                nodes.append(entity)
            waiting = [*entity.execute(context), *waiting]
    return nodes, context
