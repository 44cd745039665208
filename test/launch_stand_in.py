"""As much of launch and launch_ros as the launch file uses: they have no wheels, so a test has to perform it itself.

The stand-ins take the arguments that Jazzy's take and no others, and refuse the values that Jazzy's refuse.
"""

import os
import re
import runpy
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, List, get_args  # noqa: UP035 - launch compares types with typing's
from unittest.mock import patch

import yaml

from bodycam_ros.nodes.graph import NodeProcess


class LaunchContext:
    def __init__(self, arguments: Mapping[str, str]) -> None:
        self.launch_configurations = dict(arguments)
        self.environment = dict(os.environ)
        self.started: list[ExecuteProcess] = []
        """Of the stand-in alone: what would run."""


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
        default_value: str | LaunchConfiguration | None = None,
        description: str | None = None,
        choices: Iterable[str] | None = None,
    ) -> None:
        self.name, self.default_value, self.description = name, default_value, description
        self.choices = None if choices is None else list(choices)
        assert isinstance(default_value, str | LaunchConfiguration | None), f"{name}: a default is text"
        assert description, f"{name}: without a description nobody knows what it is for"
        assert self.choices is None or not isinstance(default_value, str) or default_value in self.choices, name

    def execute(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity]:
        if self.name not in context.launch_configurations:
            if self.default_value is None:
                raise RuntimeError(f"Included launch description missing required argument '{self.name}'")
            default = self.default_value
            context.launch_configurations[self.name] = default if isinstance(default, str) else default.perform(context)
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


class ExecutableInPackage:
    def __init__(self, executable: str, package: str) -> None:
        self.executable, self.package = executable, package


class ExecuteProcess(LaunchDescriptionEntity):
    """A process; ``name`` is that of its lines on the screen."""

    def __init__(
        self,
        *,
        cmd: Iterable[str | ExecutableInPackage],
        name: str | None = None,
        output: str = "log",
        respawn: bool = False,
        respawn_delay: float | None = None,
        sigterm_timeout: str = "5",
        sigkill_timeout: str = "5",
        additional_env: Mapping[str, str | EnvironmentVariable] | None = None,
    ) -> None:
        self.cmd, self.name = list(cmd), name
        assert self.cmd and all(isinstance(word, str | ExecutableInPackage) for word in self.cmd)
        assert isinstance(respawn, bool) and isinstance(respawn_delay, float | None) and output == "screen"
        assert all(isinstance(text, str) and float(text) > 0.0 for text in (sigterm_timeout, sigkill_timeout))
        self.respawn, self.respawn_delay = respawn, respawn_delay
        self._more = additional_env or {}
        self.additional_env: dict[str, str] = {}
        self.leave_s = float(sigterm_timeout) + float(sigkill_timeout)

    def execute(self, context: LaunchContext) -> Iterable[LaunchDescriptionEntity]:
        self.additional_env = {
            name: text if isinstance(text, str) else text.perform(context) for name, text in self._more.items()
        }
        context.started.append(self)
        return ()


class ParameterValue:
    """A value that is taken as it is; any other text launch_ros reads as YAML."""

    def __init__(self, value: Any, *, value_type: Any = None) -> None:
        of_list = get_args(value_type)
        known = (bool, int, float, str)
        assert value_type in (*known, *(List[kind] for kind in known))  # noqa: UP006
        expected = all(isinstance(each, of_list) for each in value) if of_list else isinstance(value, value_type)
        assert expected, f"{value} is no {value_type}"
        self.value = value


class Node(ExecuteProcess):
    """A node's process; ``command_arguments`` are those that launch_ros would give it."""

    def __init__(
        self,
        *,
        package: str,
        executable: str,
        name: str | None = None,
        namespace: str | None = None,
        parameters: Sequence[str | Path | Mapping[str, Any]],
        remappings: Iterable[tuple[str, str]] = (),
        arguments: Iterable[str] = (),
        ros_arguments: Iterable[str] = (),
        **of_process: Any,
    ) -> None:
        super().__init__(cmd=[ExecutableInPackage(executable, package), *arguments], name=name, **of_process)
        assert name is None or re.fullmatch(r"[A-Za-z_]\w*", name), f"{name} is no name for a node"
        assert isinstance(parameters, list), "launch_ros takes parameters in a list"
        self.package, self.executable, self.node_name = package, executable, name or executable
        self.is_named = name is not None
        self.namespace = None if namespace is None else f"/{namespace.strip('/')}"
        assert self.namespace is None or re.fullmatch(r"(/[A-Za-z_]\w*)+", self.namespace), f"{namespace} is none"
        self.ros_arguments = list(ros_arguments)
        assert all(isinstance(word, str) for word in self.ros_arguments)
        self.remappings = [(str(source), str(target)) for source, target in remappings]
        self.files = [Path(part) for part in parameters if not isinstance(part, Mapping)]
        self.parameters: dict[str, Any] = {}
        for part in parameters:
            if isinstance(part, Mapping):
                self.parameters |= {key: _allowed(key, value) for key, value in part.items()}

    def command_arguments(self, folder: Path) -> list[str]:
        """Parameters given in the launch file travel in a file of their own, which is written to ``folder``."""
        full_name = f"{self.namespace or ''}/{self.node_name}"
        given = folder / f"{full_name.strip('/').replace('/', '.')}.params.yaml"
        whose = full_name if self.namespace and self.is_named else "/**"
        given.write_text(yaml.safe_dump({whose: {"ros__parameters": self.parameters}}))
        files = [part for path in [*self.files, given] for part in ("--params-file", str(path))]
        namespace = ["-r", f"__ns:={self.namespace}"] if self.namespace else []
        moved = [part for source, target in self.remappings for part in ("-r", f"{source}:={target}")]
        named = ["-r", f"__node:={self.node_name}"] if self.is_named else []
        extra = ["--ros-args", *self.ros_arguments] if self.ros_arguments else []
        return [*map(str, self.cmd[1:]), *extra, "--ros-args", *named, *namespace, *files, *moved]


def _allowed(name: str, value: Any) -> Any:
    if isinstance(value, ParameterValue):
        return value.value
    if isinstance(value, (list, tuple)):
        assert value and len({type(each) for each in value}) == 1, f"{name}: launch takes no empty or mixed lists"
        return [_as_yaml(name, each) for each in value]
    return _as_yaml(name, value)


def _as_yaml(name: str, value: Any) -> Any:
    value = yaml.safe_load(value) if isinstance(value, str) else value
    assert isinstance(value, (bool, int, float, str)), f"{name}: launch takes no {type(value).__name__}"
    return value


class PackageNotFoundError(KeyError):
    pass


@dataclass(frozen=True)
class LaunchedProcess(NodeProcess):
    """A node with the command line that launch gives it."""

    command: tuple[str, ...] = ()

    @classmethod
    def of(cls, node: Node, folder: Path) -> "LaunchedProcess":
        """The process of a node; its parameters travel in a file in ``folder``."""
        command = tuple(node.command_arguments(folder))
        return cls(node.executable, node.node_name, node.parameters, node.namespace or "", command=command)

    def arguments(self, config: Path | None = None) -> list[str]:
        return list(self.command)


def performed(
    launch_file: Path, share: Path, installed: Sequence[str] = (), **arguments: str
) -> tuple[list[Node], LaunchContext]:
    """The nodes that ``ros2 launch <file> <arguments>`` starts, and the context that they are started in.

    Args:
        launch_file: the launch file.
        share: what is the package's share folder in it.
        installed: ROS packages that are there beside it.
        arguments: of the launch file.

    Raises:
        RuntimeError: an argument is missing or none of its choices.
    """
    modules = {
        "launch": [LaunchContext, LaunchDescription, LaunchDescriptionEntity],
        "launch.actions": [DeclareLaunchArgument, ExecuteProcess, OpaqueFunction, SetEnvironmentVariable],
        "launch.substitutions": [EnvironmentVariable, LaunchConfiguration],
        "launch_ros": [],
        "launch_ros.actions": [Node],
        "launch_ros.parameter_descriptions": [ParameterValue],
        "launch_ros.substitutions": [ExecutableInPackage],
        "ament_index_python": [],
        "ament_index_python.packages": [PackageNotFoundError],
    }
    standing_in = {name: ModuleType(name) for name in modules}
    for name, classes in modules.items():
        vars(standing_in[name]).update({each.__name__: each for each in classes})

    def prefix(package: str) -> str:
        if package not in installed:
            raise PackageNotFoundError(package)
        return str(share)

    vars(standing_in["ament_index_python.packages"]).update(
        get_package_share_directory=lambda package: str(share), get_package_prefix=prefix
    )
    context = LaunchContext(arguments)
    with patch.dict(sys.modules, standing_in):
        waiting = list(runpy.run_path(str(launch_file))["generate_launch_description"]().entities)
        while waiting:
            entity = waiting.pop(0)
            waiting = [*entity.execute(context), *waiting]
    return [process for process in context.started if isinstance(process, Node)], context
