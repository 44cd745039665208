"""The command line of each step, with what it reads and writes."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class Step:
    """One command.

    Attributes:
        name: unique, as "walk: replay".
        words: of the command line, without ``--jobs``; the first is the command.
        inputs: files and folders that it reads.
        output: file or folder that it writes.
        is_parallel: it takes ``--jobs``.
    """

    name: str
    words: tuple[str, ...]
    inputs: tuple[Path, ...]
    output: Path
    is_parallel: bool = True

    @property
    def stage(self) -> str:
        """The command: "replay"."""
        return self.words[0]


def map_step(name: str, reference: Path, output: Path) -> Step:
    """Photographs of a place -> its map."""
    return Step(name, ("map", str(reference), "-o", str(output), "--force"), (reference,), output)


def ingest_step(
    name: str, videos: Path, output: Path, lenses: Path | None, rig: Path | None, settings: Path | None
) -> Step:
    """A folder of videos -> a bag."""
    words = ("ingest", str(videos), "-o", str(output), "--force")
    flags = (*_flag("--lenses", lenses), *_flag("--rig", rig), *_flag("--config", settings))
    return Step(name, (*words, *flags), (videos, *_given(lenses, rig, settings)), output)


def body_step(name: str, bag: Path, map_path: Path, rig: Path, output: Path, settings: Path | None) -> Step:
    """A range of motion -> a body."""
    words = ("body", str(bag), "--map", str(map_path), "--rig", str(rig), "-o", str(output), "--force")
    inputs = (bag, map_path, rig, *_given(settings))
    return Step(name, (*words, *_flag("--config", settings)), inputs, output)


def replay_step(
    name: str,
    bag: Path,
    map_path: Path,
    body: Path,
    output: Path,
    settings: Path | None,
    equipment: Path | str | None,
) -> Step:
    """A recording -> a bag with joint states.

    Args:
        equipment: a file, or the name of a supplied one.
    """
    words = ("replay", str(bag), "--map", str(map_path), "--body", str(body), "-o", str(output), "--force")
    flags = (*_flag("--equipment", equipment), *_flag("--config", settings))
    equipment_file = (equipment,) if isinstance(equipment, Path) else ()
    return Step(name, (*words, *flags), (bag, map_path, body, *_given(settings), *equipment_file), output)


def evaluate_step(name: str, result: Path, bag: Path, output: Path, truth: Path | None = None) -> Step:
    """A solved recording -> a report."""
    words = ("evaluate", str(result), "--recording", str(bag), *_flag("--truth", truth), "-o", str(output))
    return Step(name, words, (result, bag, *_given(truth)), output, is_parallel=False)


def export_step(name: str, result: Path, output: Path, format_name: str) -> Step:
    """A solved recording -> a file for other programs."""
    words = ("export", str(result), "--to", format_name, "-o", str(output), "--force")
    return Step(name, words, (result,), output, is_parallel=False)


def _flag(name: str, value: Path | str | None) -> Sequence[str]:
    return () if value is None else (name, str(value))


def _given(*paths: Path | None) -> tuple[Path, ...]:
    return tuple(path for path in paths if path is not None)
