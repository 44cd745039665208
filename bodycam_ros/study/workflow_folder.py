"""The folder of a study: the workflow that is written to it, and where the logs of its jobs are.

Paths in what is written lead from the folder, so that a study and its recordings may be moved together.

Snakemake locks its folder by files, which stay when it is killed. The lock here is of the system, and passes on to the
Snakemake that is started: it is free exactly when neither of the two lives any more.
"""

import fcntl
import json
import os
import platform
import shlex
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any

import yaml

from bodycam_ros import __version__
from bodycam_ros.errors import OutputError, StudyError
from bodycam_ros.output_place import check_output
from bodycam_ros.shown import printable
from bodycam_ros.study.job_resources import JobResources
from bodycam_ros.study.steps import Step
from bodycam_ros.study.study import SETTINGS, STAGES, Study, StudySteps
from bodycam_ros.whole_file import failure_named, write_whole

SNAKEFILE, STEPS = "Snakefile", "steps.json"


@dataclass(frozen=True)
class WorkflowFolder:
    """Where a study's workflow is.

    Attributes:
        path: absolute, links followed.
        study: whose it is.
    """

    path: Path
    study: Study

    @classmethod
    def at(cls, path: Path, study: Study) -> "WorkflowFolder":
        """The folder, which need not be there.

        Raises:
            OutputError: it holds something else, or what the study reads.
        """
        check_output(path, study.inputs)
        if path.exists() and (not path.is_dir() or (any(path.iterdir()) and not (path / STEPS).exists())):
            raise OutputError(f"{path}: is there, and is no folder of a study (it has no {STEPS}); choose another name")
        return cls(Path(os.path.realpath(path)), study)

    def write(self, steps: StudySteps, resources: JobResources) -> None:
        """Write Snakefile, steps and settings; what says the same already is left alone.

        Raises:
            OutputError: they cannot be written.
        """
        self.path.mkdir(parents=True, exist_ok=True)
        jobs: dict[str, dict[str, Any]] = {stage: {} for stage in STAGES}
        for step in steps:
            jobs[step.stage][self._at(step)] = self._job(step)
        written = {
            "version": __version__,
            "bodycam": shlex.join([sys.executable, "-m", "bodycam_ros.cli.main"]),
            "threads": {stage: resources.threads[stage] for stage in STAGES},
            "memory_mb": {stage: resources.memory_mb[stage] for stage in STAGES},
            "steps": jobs,
        }
        self._write(SNAKEFILE, files("bodycam_ros.study").joinpath(SNAKEFILE).read_text(encoding="utf-8"))
        self._write(STEPS, json.dumps(written, indent=1, ensure_ascii=False) + "\n")
        if self.study.settings is not None and not isinstance(self.study.settings, Path):
            document = {"/**": {"ros__parameters": dict(self.study.settings)}}
            self._write(SETTINGS, yaml.safe_dump(document, sort_keys=False, allow_unicode=True))

    def log_of(self, step: Step) -> Path:
        """What a job said."""
        return self.path / "logs" / step.stage / f"{self._at(step)}.log"

    def seconds_of(self, step: Step) -> float | None:
        """How long a job took [s]; None if it is not done."""
        try:
            header, values = self.log_of(step).with_suffix(".tsv").read_text().splitlines()[:2]
            return float(dict(zip(header.split("\t"), values.split("\t"), strict=False))["s"])
        except (OSError, ValueError, KeyError):
            return None

    def _at(self, step: Step) -> str:
        """What stands for ``{at}`` in the rule of a step."""
        kind, name, *rest = step.output.relative_to(self.path).parts
        if step.stage == "ingest":
            return f"{kind}/{name}"
        return "/".join((name, *rest)) if step.stage == "export" else name

    def _job(self, step: Step) -> dict[str, Any]:
        paths = {str(path): self._said(path) for path in (*step.inputs, step.output)}
        return {
            "name": step.name,
            "words": shlex.join(paths.get(word, word) for word in step.words),
            "reads": [self._said(path) for path in step.inputs],
            "makes": [self._said(path) for path in (step.output, *step.beside)],
        }

    def _said(self, path: Path) -> str:
        """A path as the workflow has it: from the folder on, if it is of the study; else absolute."""
        path = Path(os.path.realpath(path.parent), path.name)
        near = os.path.realpath(self.study.path.parent)
        of_study = path.is_relative_to(self.path) or path.is_relative_to(near)
        return os.path.relpath(path, self.path) if of_study else str(path)

    def _write(self, name: str, text: str) -> None:
        """Write a file, unless it says that already: what is newer is taken for changed."""
        path = self.path / name
        try:
            if path.read_text(encoding="utf-8") == text:
                return
        except (OSError, ValueError):
            pass
        write_whole(path, text)


def folder_of(study: Path) -> Path:
    """Where a study goes if nobody says: beside its file, under its name."""
    return study.with_suffix("") if study.suffix else study.with_name(f"{study.name}_study")


def stages_of(steps: Iterable[Step]) -> dict[str, int]:
    """Stage -> how many jobs of it there are."""
    counts = dict.fromkeys(STAGES, 0)
    for step in steps:
        counts[step.stage] += 1
    return counts


LOCK = ".bodycam-study"
_SNAKEMAKE_LOCKS = Path(".snakemake", "locks")


@dataclass(frozen=True)
class StudyLock:
    """The lock of a folder, held.

    Attributes:
        descriptor: to be passed on to Snakemake.
        is_left: a run before us was killed on this machine, and Snakemake's own lock, which stayed, may be removed.
    """

    descriptor: int
    is_left: bool


@contextmanager
def study_lock(folder: Path) -> Iterator[StudyLock]:
    """Hold the lock of a study's folder.

    Raises:
        StudyError: another run holds it, or a Snakemake that somebody else started.
        OutputError: the folder cannot be written to.
    """
    with failure_named(folder / LOCK):
        descriptor = os.open(folder / LOCK, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
    try:
        said = _said(descriptor)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            raise StudyError(f"{folder}: another 'bodycam study' is at work in it{_who(said)}; wait for it") from error
        is_locked = any((folder / _SNAKEMAKE_LOCKS).glob("*"))
        if is_locked and said.get("host") != platform.node():
            elsewhere = f"a run{_who(said)} that did not end in order, or by " if said else ""
            raise StudyError(
                f"{folder}: is locked by {elsewhere}a snakemake that 'bodycam study' did not start. If none is at work "
                f"any more: snakemake --unlock --directory {folder}"
            )
        _write(descriptor, {"host": platform.node(), "pid": os.getpid()})
        yield StudyLock(descriptor, is_locked)
        if not any((folder / _SNAKEMAKE_LOCKS).glob("*")):
            _write(descriptor, {})
    finally:
        os.close(descriptor)


def _who(said: dict[str, object]) -> str:
    return printable(f" (process {said.get('pid')} on {said.get('host')})") if said else ""


def _said(descriptor: int) -> dict[str, object]:
    try:
        said = json.loads(os.pread(descriptor, 4096, 0) or b"{}")
    except ValueError:
        return {}
    return said if isinstance(said, dict) else {}


def _write(descriptor: int, said: dict[str, object]) -> None:
    os.ftruncate(descriptor, 0)
    os.pwrite(descriptor, json.dumps(said).encode(), 0)
