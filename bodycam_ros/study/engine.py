"""Runs the steps of a study by Snakemake, here or on a cluster; a failed step stops only those that depend on it."""

import json
import os
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path
from typing import IO, Any

from bodycam_ros.errors import StudyError
from bodycam_ros.files.whole_file import failure_named
from bodycam_ros.study.step_graph import NOTES, StepGraph
from bodycam_ros.study.step_needs import StepNeeds
from bodycam_ros.study.study import Step
from bodycam_ros.study.study_lock import VARIABLE

INSTALL = 'pip install "bodycam_ros[study]"'
_STATE = ".snakemake"
_MAX_HASHED = 4_000_000  # [bytes] larger inputs hold images; their time of change identifies them
_MAX_CLEANUP_S = 60.0  # a replay needs two seconds to clean up after an interruption
_OWN = Path(__file__).parent
_PROFILE = re.compile(r"(profile|config)(\.v\d+\+)?\.yaml")  # as Snakemake has them


@dataclass(frozen=True)
class StepEnd:
    """How a step ended.

    Attributes:
        seconds: how long it took.
        failure: why it failed, or could not run; None if it is done.
    """

    step: Step
    seconds: float
    failure: str | None


class Engine:
    """Snakemake for one study.

    Args:
        graph: the steps in their folder of results.
        needs: what steps are given.
        cores: of this machine, to be used by all processes together.
        profile: Snakemake's profile of a cluster, a name or path; None for this machine.
    """

    def __init__(self, graph: StepGraph, needs: StepNeeds, cores: int, profile: str | None) -> None:
        self._graph = graph
        self._needs = needs
        where = ("none", "--cores", str(cores)) if profile is None else (find_profile(profile),)
        self._where = ("--profile", *where)  # always one, as a variable of the user's may name another

    def steps_to_run(self) -> list[Step]:
        """Steps whose command, inputs or software changed or output is missing, and those that read their outputs.

        Raises:
            StudyError: a step must run again, but its output was changed by hand since.
        """
        planned = set(self._graph.steps)
        if (self._graph.folder / _STATE).exists():
            with tempfile.TemporaryDirectory() as scratch:
                plan = Path(scratch, "graph.json")
                self._graph.write(plan, self._needs)
                events = self._events(plan, ("--dry-run",), None)
                rules = {event.get("rule_name") for event in events}
                planned = {step for rule, step in self._graph.by_rule.items() if rule in rules}
        steps = [step for step in self._graph.steps if step in planned]
        for step in steps:
            if self._graph.is_changed_by_hand(step):
                raise StudyError(
                    f"{step.output}: was changed by hand, and its inputs have changed since. To keep it, move it and "
                    "name it as an input (body.yaml or map/ of a folder; body or map in a study file); to have it "
                    "made again, remove it"
                )
        return steps

    def run(self, planned: Sequence[Step], lock: Path) -> Generator[Step | StepEnd, None, None]:
        """Run steps; yields each when it starts and its ``StepEnd``, of one that is tried again several.

        Args:
            planned: those that ``steps_to_run`` gave.
            lock: of the folder of results; what runs here ends when this process gives it up.

        Raises:
            StudyError: Snakemake cannot run, as with a profile that asks for what the cluster does not have.
        """
        graph = Path(NOTES, "graph.json")
        with failure_named(self._graph.folder / NOTES):
            (self._graph.folder / NOTES).mkdir(exist_ok=True)
        self._graph.write(self._graph.folder / graph, self._needs)
        self._graph.write_scripts()
        self._graph.remove_logs(planned)
        rules: dict[int, Step] = {}
        started: dict[Step, float] = {}
        failed: dict[Step, str] = {}
        open_steps = dict.fromkeys(planned)
        for event in self._events(graph, (), lock):
            kind = event["event"]
            if kind == "job_info" and (step := self._graph.by_rule.get(event["rule_name"])):
                rules[event["jobid"]] = step
                started[step] = time.monotonic()
                yield step
            if kind == "job_finished" and (step := rules.get(event["job_id"])):
                open_steps.pop(step, None)
                failed.pop(step, None)  # it was tried again
                seconds = self._graph.seconds(step)
                yield StepEnd(step, time.monotonic() - started[step] if seconds is None else seconds, None)
            if kind == "job_error" and (step := rules.get(event["jobid"])):
                failed[step] = self._graph.failure(step, _cluster_cause(event))
                yield StepEnd(step, time.monotonic() - started[step], failed[step])
        yield from self._not_run(open_steps, failed)

    def _not_run(self, open_steps: dict[Step, None], failed: dict[Step, str]) -> Iterator[StepEnd]:
        """The ends of those that wait for one that failed.

        Raises:
            StudyError: another did not run either.
        """
        first = {step.output: step for step in failed}
        for step in open_steps:
            if step in failed:
                continue
            if (cause := next((first[path] for path in step.inputs if path in first), None)) is None:
                raise self._failed(f"it ended before step '{step.name}'")
            first[step.output] = cause
            yield StepEnd(step, 0.0, f"not run, because step '{cause.name}' failed")

    def _events(self, graph: Path, more: Sequence[str], lock: Path | None) -> Iterator[dict[str, Any]]:
        """Run Snakemake, and yield its events; an interruption ends it and all that it has started.

        Args:
            graph: from the folder of results on.
            more: further arguments.
            lock: of the folder of results; None to plan.
        """
        if find_spec("snakemake") is None:
            raise StudyError(f"'bodycam run' and 'bodycam study' need Snakemake, which is not installed: {INSTALL}")
        reading, writing = os.pipe()
        command = [
            *(sys.executable, "-P", "-m", "bodycam_ros.study.engine_process", str(writing)),
            *("--snakefile", str(_OWN / "steps.smk"), "--directory", str(self._graph.folder)),
            *("--config", f"graph={graph}", "--workflow-profile", "none", *self._where),
            *("--rerun-triggers", "mtime", "params", "input", "--max-checksum-file-size", str(_MAX_HASHED)),
            # Ours is released by the system. Nothing that our commands leave is incomplete.
            *("--nolock", "--keep-going", "--keep-incomplete", "--rerun-incomplete", "--scheduler", "greedy", *more),
        ]
        environment = dict(os.environ) if lock is None else {**os.environ, VARIABLE: str(lock)}
        if not _has_cache():
            environment["XDG_CACHE_HOME"] = str(self._graph.folder / _STATE / "cache")
        has_failed, problem = False, ""
        with open(reading, encoding="utf-8") as pipe, self._output(lock) as output:
            # In a session of its own: a terminal's Ctrl-C reaches it through us, once.
            try:
                process = subprocess.Popen(
                    command,
                    stdin=subprocess.DEVNULL,
                    stdout=output,
                    stderr=output,
                    pass_fds=(writing,),
                    env=environment,
                    start_new_session=True,
                )
            finally:
                os.close(writing)
            with _ended(process):
                for line in pipe:
                    event = json.loads(line)
                    if event["event"] == "error":
                        problem = event["text"]
                        continue
                    has_failed |= event["event"] == "job_error"
                    yield event
                code = process.wait()
                if code and (code < 0 or not has_failed):
                    raise self._failed(_cause(problem) or _last_line(output) or f"code {code}")

    def _failed(self, cause: str) -> StudyError:
        return StudyError(f"{self._graph.folder}: the engine (Snakemake) failed: {cause}")

    @contextmanager
    def _output(self, lock: Path | None) -> Iterator[IO[bytes] | None]:
        """Where Snakemake prints to: a file, which is kept unless it plans, or the terminal as the steps do."""
        if lock is None:
            with tempfile.TemporaryFile() as file:
                yield file
        elif not self._graph.is_logged:
            yield None
        else:
            with failure_named(self._log):
                self._log.parent.mkdir(exist_ok=True)
                log = self._log.open("w+b")
            with log:
                yield log

    @property
    def _log(self) -> Path:
        return self._graph.folder / "logs" / "engine.log"


def _cause(problem: str) -> str:
    """An error of the engine; of a traceback its last line."""
    text = problem.strip()
    return text.splitlines()[-1] if text.startswith("Traceback") else text


def _last_line(file: IO[bytes] | None) -> str:
    """The last line of what was printed to a file."""
    if file is None:
        return ""
    file.seek(0)
    return (file.read().decode(errors="replace").strip().splitlines() or [""])[-1]


def _has_cache() -> bool:
    """Whether there is a folder for Snakemake's cache, or may be made: in some containers there is no home."""
    cache = Path(os.environ.get("XDG_CACHE_HOME") or os.path.expanduser("~/.cache"))
    return os.access(next(folder for folder in (cache, *cache.parents) if folder.exists()), os.W_OK)


def _cluster_cause(error: dict[str, Any]) -> str:
    """Why a job failed on a cluster, and the file with more; empty for a job on this machine."""
    first = " ".join((error["rule_msg"] or "").partition("For further error details")[0].split()).rstrip(".")
    of_cluster = error["log"][1:]  # the first is that of the step
    return f"{first}; what the cluster printed is in {of_cluster[-1]}" if first and of_cluster else first


@contextmanager
def _ended(process: "subprocess.Popen[bytes]") -> Iterator[None]:
    """End Snakemake, if it runs: by SIGINT, so that it takes jobs from a queue; steps here by SIGTERM."""
    from psutil import NoSuchProcess, Process, wait_procs

    try:
        yield
    finally:
        ended: set[Process] = set()
        deadline = time.monotonic() + _MAX_CLEANUP_S
        if process.poll() is None:
            process.send_signal(signal.SIGINT)
        while process.poll() is None and time.monotonic() < deadline:
            with suppress(NoSuchProcess):
                for step in set(Process(process.pid).children(recursive=True)) - ended:
                    ended.add(step)
                    step.terminate()
            time.sleep(0.05)
        _, alive = wait_procs(ended, max(0.1, deadline - time.monotonic()))
        for left in alive:
            left.kill()
        process.kill()
        process.wait()


def find_profile(name: str) -> str:
    """A profile by its path, the user's own of that name, or ours.

    Raises:
        StudyError: there is none.
    """
    places = [
        Path(os.environ.get("XDG_CONFIG_HOME") or os.path.expanduser("~/.config"), "snakemake"),
        Path("/etc/xdg/snakemake"),
    ]
    for folder in (Path(), *places, _OWN / "profiles"):
        if any(_PROFILE.fullmatch(file.name) for file in (folder / name).glob("*.yaml")):
            return str((folder / name).absolute())
    own = ", ".join(sorted(path.name for path in (_OWN / "profiles").iterdir()))
    raise StudyError(
        f"--profile {name}: is no folder with a config.yaml, no profile of yours ({places[0]}/{name}/config.yaml) and "
        f"none of ours ({own})"
    )
