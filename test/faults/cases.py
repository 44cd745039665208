"""All cases of the campaign, by kind; a seed and a case's name say all of it."""

import re
import signal
import zlib
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np
from faults import (
    bag_damage,
    byte_damage,
    lie_damage,
    map_damage,
    place_damage,
    result_damage,
    stream_damage,
    urdf_damage,
    yaml_damage,
)
from faults.work import Attempt, Make, Work

Run = Callable[[Work], Attempt]

_REPLAY: Run = lambda work: work.replay()  # noqa: E731
_BODY: Run = lambda work: work.body()  # noqa: E731
_MAP: Run = lambda work: work.map()  # noqa: E731
_EVALUATE: Run = lambda work: work.evaluate()  # noqa: E731
_EXPORT: Run = lambda work: work.export()  # noqa: E731


_LEAST = 3
"""Cases of a kind."""

INTACT = "intact"
"""The kind of good inputs."""


@dataclass(frozen=True)
class Case:
    """One corruption: kind and name of the damage, and which of its variants."""

    kind: str
    name: str
    number: int
    make: Make

    @property
    def title(self) -> str:
        """As ``--case`` takes it."""
        return f"{self.kind}/{self.name}/{self.number}"

    def random(self, seed: int) -> np.random.Generator:
        """Random numbers of its own, whatever other cases are run."""
        return np.random.default_rng([seed, zlib.crc32(self.title.encode())])


_BAG_IS_DAMAGED = r"is cut off|damaged"
_CUTS = ("cut", "cut a little", "zeroed block", "random bytes after the head")
"""Damages to a bag that leave less of it, or no index, and which a run that works all the same has to name."""


def _bytes_of(name: str, damages: Mapping[str, byte_damage.Damage], *runs: Run) -> dict[str, Make]:
    """A case for each damage to a file; the commands take turns."""

    def make_of(damage: byte_damage.Damage, run: Run) -> Make:
        def make(work: Work, random: np.random.Generator) -> Attempt:
            work.own(name.split("/", 1)[0])
            path = work.folder / name
            path.write_bytes(damage(path.read_bytes(), random))
            is_cut = path.suffix == ".mcap" and any(damage is byte_damage.DAMAGES[cut] for cut in _CUTS)
            return replace(run(work), must_say=_BAG_IS_DAMAGED) if is_cut else run(work)

        return make

    where = name.rsplit("/", 1)[-1]
    pairs = enumerate(damages.items())
    return {f"{where}: {what}": make_of(damage, runs[number % len(runs)]) for number, (what, damage) in pairs}


def _text_of(name: str, damages: Mapping[str, yaml_damage.Damage], *runs: Run) -> dict[str, Make]:
    """As ``_bytes_of`` for damages to text."""

    def as_bytes(damage: yaml_damage.Damage) -> byte_damage.Damage:
        return lambda content, random: damage(content.decode(), random).encode("utf-8", "surrogateescape")

    return _bytes_of(name, {what: as_bytes(damage) for what, damage in damages.items()}, *runs)


def _swapped() -> dict[str, Make]:
    """One file in the place of another."""
    files = {
        "recording/recording.mcap": _REPLAY,
        "recording/metadata.yaml": _REPLAY,
        "map/map.yaml": _REPLAY,
        "map/landmarks.npz": _REPLAY,
        "body.yaml": _REPLAY,
        "body.urdf": lambda work: work.replay(body="body.urdf"),
        "rig.yaml": _BODY,
        "equipment.yaml": lambda work: work.replay("--equipment", str(work.of("equipment.yaml"))),
        "settings.yaml": lambda work: work.replay("--config", str(work.of("settings.yaml"))),
        "reference/ref_0101.jpg": _MAP,
        "solved/solved.mcap": _EVALUATE,
    }

    def make_of(name: str, other: str, run: Run) -> Make:
        def make(work: Work, random: np.random.Generator) -> Attempt:
            work.own(name.split("/", 1)[0])
            (work.folder / name).write_bytes((work.stock / other).read_bytes())
            return run(work)

        return make

    return {
        f"{other} for {name}": make_of(name, other, run)
        for name, run in files.items()
        for other in files
        if other != name
    }


def _stopped() -> dict[str, Make]:
    """Commands that are told to stop, at any moment from their first instant."""
    commands = {"replay": _REPLAY, "body": _BODY, "map": _MAP, "evaluate": _EVALUATE}

    def make_of(run: Run, number: int, span: tuple[float, float]) -> Make:
        return lambda work, random: replace(run(work), stop=(number, float(random.uniform(*span))))

    return {
        f"{command} gets {signal.Signals(number).name} {moment}": make_of(run, number, span)
        for command, run in commands.items()
        for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
        for moment, span in {"at once": (0.02, 0.4), "soon": (0.4, 1.5), "later": (1.5, 4.0)}.items()
    }


def _settings(work: Work) -> Attempt:
    return work.replay("--config", str(work.of("settings.yaml")))


def _settings_of_body(work: Work) -> Attempt:
    return work.body("--config", str(work.of("settings.yaml")))


def _riding(work: Work) -> Attempt:
    return work.replay("--equipment", str(work.of("equipment.yaml")))


def _truth(work: Work) -> Attempt:
    return work.evaluate("--truth", str(work.of("truth")))


def _with_pixels(work: Work) -> Attempt:
    return work.evaluate("--recording", str(work.of("recording")))


def _urdf(work: Work) -> Attempt:
    return work.replay(body="body.urdf")


def _body_exported(work: Work) -> Attempt:
    return work.export("body.yaml")


def _intact() -> dict[str, Make]:
    """Good inputs, without which the rest would prove nothing."""
    runs = {
        "replay": _REPLAY,
        "replay of a URDF": _urdf,
        "replay with settings": _settings,
        "replay with equipment": _riding,
        "evaluate": _EVALUATE,
        "evaluate with pixels": _with_pixels,
        "evaluate with the truth": _truth,
        "export": _EXPORT,
        "export a body": _body_exported,
        "map": _MAP,
        "evaluate against points": lambda work: work.evaluate(
            "--truth", str(work.of("points.trc")), "--points", str(work.of("points.yaml")), solved="walked"
        ),
        **{f"export {to}": (lambda work, to=to: work.export_motion(to)) for to in result_damage.FORMATS},
    }
    return {name: (lambda work, random, run=run: replace(run(work), is_good=True)) for name, run in runs.items()}


_BYTES, _YAML = byte_damage.DAMAGES, yaml_damage.DAMAGES

KINDS: Mapping[str, Mapping[str, Make]] = {
    INTACT: _intact(),
    "bag": {
        **_bytes_of("recording/recording.mcap", {**_BYTES, **bag_damage.DAMAGES}, _REPLAY, _BODY, _with_pixels),
        **_bytes_of("recording/metadata.yaml", _BYTES, _REPLAY),
        **_text_of("recording/metadata.yaml", _YAML, _REPLAY),
        **_bytes_of("solved/solved.mcap", {**_BYTES, **bag_damage.DAMAGES}, _EVALUATE, _EXPORT),
    },
    "map": {
        **_bytes_of("map/landmarks.npz", {**_BYTES, **map_damage.DAMAGES}, _REPLAY),
        **_bytes_of("map/map.yaml", _BYTES, _BODY),
        **_text_of("map/map.yaml", _YAML, _REPLAY, _BODY),
    },
    "body": {
        **_bytes_of("body.yaml", _BYTES, _REPLAY, _body_exported),
        **_text_of("body.yaml", _YAML, _REPLAY, _body_exported),
        **_bytes_of("body.urdf", _BYTES, _urdf),
        **_text_of("body.urdf", urdf_damage.DAMAGES, _urdf),
    },
    "rig": {**_bytes_of("rig.yaml", _BYTES, _BODY), **_text_of("rig.yaml", _YAML, _BODY)},
    "equipment": {
        **_bytes_of("equipment.yaml", _BYTES, _riding),
        **_text_of("equipment.yaml", _YAML, _riding),
    },
    "settings": {
        **_bytes_of("settings.yaml", _BYTES, _settings),
        **_text_of("settings.yaml", _YAML, _settings, _settings_of_body),
    },
    "reference": {
        **_bytes_of("reference/ref_0101.jpg", _BYTES, _MAP),
        **_bytes_of("reference/camera.yaml", _BYTES, _MAP),
        **_text_of("reference/camera.yaml", _YAML, _MAP),
        **_text_of("reference/board.yaml", _YAML, _MAP),
    },
    "truth": _bytes_of("truth/truth/segments/head.tum", _BYTES, _truth),
    "swapped": _swapped(),
    "place": place_damage.DAMAGES,
    "stream": stream_damage.DAMAGES,
    "result": result_damage.DAMAGES,
    "lie": lie_damage.DAMAGES,
    "signal": _stopped(),
}
"""Kind -> name of the damage -> what prepares it."""


def chosen(count: int | None, seed: int, kinds: frozenset[str]) -> Iterator[Case]:
    """So many cases of some kinds, each kind with its share; each damage once by default, in variants if more."""
    total = sum(len(KINDS[kind]) for kind in kinds)
    for kind in (kind for kind in KINDS if kind in kinds):
        names = list(KINDS[kind])
        order = np.random.default_rng([seed, zlib.crc32(kind.encode())]).permutation(len(names))
        share = len(names) if count is None else max(_LEAST, round(count * len(names) / total))
        for place in range(share):
            number, at = divmod(place, len(names))
            name = names[order[at]]
            yield Case(kind, name, number, KINDS[kind][name])


def named(title: str) -> Case:
    """The case of a title.

    Raises:
        KeyError: there is none.
    """
    match = re.fullmatch(r"([^/]+)/(.+)/(\d+)", title)
    if match is None:
        raise KeyError(title)
    return Case(match[1], match[2], int(match[3]), KINDS[match[1]][match[2]])
