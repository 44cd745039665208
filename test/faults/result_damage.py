"""Solved bags that were cut anywhere or altered, on their way into reports and files of other programs."""

import dataclasses
from collections.abc import Callable, Iterable, Mapping
from typing import Any

import numpy as np
from faults.work import Attempt, Make, Work

from bodycam_ros.recording.bag_file import BagFile
from bodycam_ros.recording.bag_writer import write_recording

Change = Callable[[str, int, Any, np.random.Generator], Iterable[Any]]
"""(topic, number of the message on it, message, random) -> what is in the bag instead."""

FORMATS = ("bvh", "trc", "csv", "npz", "tum", "glb", "c3d", "usd", "ply", "urdf", "mjcf", "mot")
_STATES = ("/joint_states", "/odometry", "/joint_rotations", "/joint_covariances", "/skeleton")
_CUTS = 8

_COMMANDS: Mapping[str, Callable[[Work], Attempt]] = {
    "evaluate": lambda work: work.evaluate(solved="walked"),
    **{f"export {to}": (lambda work, to=to: work.export_motion(to)) for to in FORMATS},
}


def _altered(change: Change, command: str, most_share: float = 1.0) -> Make:
    """The bag with altered messages, and no more than a share of all."""

    def make(work: Work, random: np.random.Generator) -> Attempt:
        source, target = work.stock / "walked", work.folder / "walked"
        counts: dict[str, int] = {}
        with BagFile(source) as bag, write_recording(target) as writer:
            most = int(most_share * sum(bag.message_count(topic) for topic in bag.topics))
            for row, (topic, recorded_ns, message) in enumerate(bag.messages(bag.topics)):
                number = counts[topic] = counts.get(topic, -1) + 1
                for new in change(topic, number, message, random) if row < most else ():
                    writer.write(topic, recorded_ns, new)
        return _COMMANDS[command](work)

    return make


def _same(topic: str, number: int, message: Any, random: np.random.Generator) -> Iterable[Any]:
    return [message]


def _without(left_out: str) -> Change:
    return lambda topic, number, message, random: () if topic.endswith(left_out) else (message,)


def _here_and_there(topic: str, number: int, message: Any, random: np.random.Generator) -> Iterable[Any]:
    return () if random.random() < 0.2 else (message,)


def _of_states(change: Callable[[Any, np.random.Generator], Any], since: int = 0) -> Change:
    """Other joint states, from the message of a number on."""

    def altered(topic: str, number: int, message: Any, random: np.random.Generator) -> Iterable[Any]:
        return [change(message, random) if topic == "/joint_states" and number >= since else message]

    return altered


def _joints(**fields: Callable[[Any], Any]) -> Callable[[Any, np.random.Generator], Any]:
    return lambda message, random: dataclasses.replace(
        message, **{name: make(getattr(message, name)) for name, make in fields.items()}
    )


def _restamped(topic: str, number: int, message: Any, random: np.random.Generator) -> Iterable[Any]:
    """Stamps at random."""
    if not hasattr(message, "header"):
        return [message]
    stamp = dataclasses.replace(message.header.stamp, sec=int(random.integers(-(2**31), 2**31)))
    return [dataclasses.replace(message, header=dataclasses.replace(message.header, stamp=stamp))]


def _described(text: Callable[[str], str]) -> Change:
    def altered(topic: str, number: int, message: Any, random: np.random.Generator) -> Iterable[Any]:
        return [dataclasses.replace(message, data=text(message.data)) if topic == "/robot_description" else message]

    return altered


_ALTERATIONS: Mapping[str, Change] = {
    **{f"without {topic}": _without(topic) for topic in (*_STATES, "/robot_description", "/verdict", "/pose", "/tf")},
    "messages missing here and there": _here_and_there,
    "angles NaN": _of_states(_joints(position=lambda position: np.asarray(position) * np.nan), since=5),
    "angles infinite": _of_states(_joints(position=lambda position: np.asarray(position) + np.inf), since=5),
    "angles of 1e300": _of_states(_joints(position=lambda position: np.asarray(position) + 1e300), since=5),
    "angles less": _of_states(_joints(position=lambda position: np.asarray(position)[:-1])),
    "names less": _of_states(_joints(name=lambda names: list(names)[:-1])),
    "names twice": _of_states(_joints(name=lambda names: [list(names)[0]] * len(names))),
    "names of escapes": _of_states(_joints(name=lambda names: ["\x1b[31mred"] * len(names))),
    "a hundred thousand angles": _of_states(
        _joints(
            name=lambda names: [f"joint_{row}" for row in range(100_000)],
            position=lambda position: np.zeros(100_000),
        ),
        since=10,
    ),
    "stamps at random": _restamped,
    "no body described": _described(lambda text: ""),
    "a body that is cut": _described(lambda text: text[: len(text) // 2]),
    "another body": _described(lambda text: text.replace("knee_left", "knee_other")),
}

DAMAGES: Mapping[str, Make] = {
    **{f"{command} of it intact": _altered(_same, command) for command in _COMMANDS},
    **{
        f"{command} of a share of it ({cut})": _altered(_same, command, (cut + 0.37) / _CUTS)
        for cut in range(_CUTS)
        for command in list(_COMMANDS)[cut % 2 :: 2]
    },
    **{
        f"{command}: {what}": _altered(change, command)
        for number, (what, change) in enumerate(_ALTERATIONS.items())
        for command in ("evaluate", f"export {FORMATS[number % len(FORMATS)]}")
    },
}
