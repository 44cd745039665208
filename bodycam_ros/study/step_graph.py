"""The steps of a study as plain data, which the engine reads: files in and out, command, and what a step needs.

A step is a script for bash beside the graph, whose argument is the number of processors. It is done when its receipt
and the main file of its output are there. The receipt, in ``steps/`` of the folder of results, has the exit code and
the time, so that it differs after each run: whatever reads the output reads the receipt as well, and follows. A hash of
the main file is beside it, by which a file that was corrected by hand is known.
"""

import hashlib
import os
import re
import shlex
import sys
from collections.abc import Iterable, Sequence
from contextlib import suppress
from pathlib import Path

import msgspec

from bodycam_ros import __version__
from bodycam_ros.files.whole_file import failure_named, write_whole
from bodycam_ros.results.verdict import WRONG_RESULT
from bodycam_ros.study.input_files import files_in
from bodycam_ros.study.step_needs import StepNeeds
from bodycam_ros.study.study import Step

NOTES = "steps"
_NOT_PLAIN = re.compile(r"\W+")
_NO_BRACES = str.maketrans("{}", "()")
_MAX_NAME = 50  # characters, of four bytes each at most; a file's name has 255 bytes
_ERROR = "bodycam: error: "
_MAX_LOG_TAIL = 20_000  # [bytes]


class GraphStep(msgspec.Struct, frozen=True):
    """A step for the engine. Paths are relative to the folder of results.

    Attributes:
        rule: its name for the engine, unique.
        inputs: files, with the receipts of the steps that make them.
        main_file: the file of its output without which that is none.
        receipt: written when it is done.
        benchmark: table of its time and memory, written by the engine.
        logs: file that it prints to; empty if that is the terminal.
        state: version of this software and flags of the command; where they differ, it runs again.
        threads: processors.
        memory_mb, minutes: what it is given at its first attempt, twice as much at each further one.
    """

    rule: str
    inputs: list[str]
    main_file: str
    receipt: str
    benchmark: str
    logs: list[str]
    state: str
    threads: int
    memory_mb: int
    minutes: int


class StepGraph:
    """The steps of a study in its folder of results.

    Attributes:
        by_rule: name for the engine -> step.

    Args:
        steps: each after the steps whose outputs it reads.
        folder: of the results, links followed.
        is_logged: what steps print goes to files in ``logs/``; else to the terminal.
    """

    def __init__(self, steps: Sequence[Step], folder: Path, is_logged: bool) -> None:
        self.steps = tuple(steps)
        self.folder = folder
        self.is_logged = is_logged
        self._rules = {
            step.name: f"{_NOT_PLAIN.sub('_', step.name)[:_MAX_NAME]}_{number}"
            for number, step in enumerate(self.steps)
        }
        self.by_rule = {self._rules[step.name]: step for step in self.steps}
        self._makers = {step.output: step for step in self.steps}

    def write(self, path: Path, needs: StepNeeds) -> None:
        """Write all steps as JSON."""
        graph = [self._graph_step(step, needs) for step in self.steps]
        write_whole(path, msgspec.json.format(msgspec.json.encode(graph)))

    def write_scripts(self) -> None:
        """Write what runs each step.

        Raises:
            OutputError: they cannot be written.
        """
        with failure_named(self.folder / NOTES):
            for step in self.steps:
                script = self.folder / NOTES / f"{self._rules[step.name]}.sh"
                script.write_bytes(os.fsencode(self._script(step)))

    def remove_logs(self, steps: Iterable[Step]) -> None:
        """Remove what earlier runs of steps printed: of one that a cluster never starts it would be taken for its own.

        Raises:
            OutputError: a file cannot be removed.
        """
        for step in steps if self.is_logged else ():
            with failure_named(self._log(step)):
                self._log(step).unlink(missing_ok=True)

    def exit_code(self, step: Step) -> int:
        """Exit code of a step that is done: 0, or 3 for a result that should not be used."""
        with suppress(OSError, ValueError, IndexError):
            return int(self._note(step, "receipt").read_text().split()[0])
        return 0

    def seconds(self, step: Step) -> float | None:
        """How long a step took [s]; None if that is unknown."""
        with suppress(OSError, ValueError, IndexError):
            return float(self._note(step, "tsv").read_text().splitlines()[1].split("\t")[0])
        return None

    def is_changed_by_hand(self, step: Step) -> bool:
        """Whether the main file is not what the step made; a body is taken for corrected if that is not known."""
        try:
            made = self._note(step, "sha256").read_text().split()[0]
        except (OSError, IndexError):
            return step.stage == "body" and step.main_file.exists()
        try:
            return hashlib.sha256(step.main_file.read_bytes()).hexdigest() != made
        except OSError:
            return False

    def failure(self, step: Step, told: str) -> str:
        """Why a step failed: its own error, else what the engine tells, else the last line that it printed."""
        if not self.is_logged:
            return "failed, as it printed above"
        text = ""
        with suppress(OSError), self._log(step).open("rb") as file:
            file.seek(max(0, file.seek(0, os.SEEK_END) - _MAX_LOG_TAIL))
            text = file.read().decode("utf-8", "replace")
        _, error, message = text.rpartition(_ERROR)
        lines = [line.strip() for line in (message if error else text).splitlines() if line.strip()]
        return " ".join(lines) if error else told or (lines or ["it printed nothing"])[-1]

    def _graph_step(self, step: Step, needs: StepNeeds) -> GraphStep:
        inputs: list[str] = []
        for path in step.inputs:
            if (maker := self._makers.get(path)) is not None:
                inputs += [self._relative(self._note(maker, "receipt")), self._relative(maker.main_file)]
            else:
                inputs += map(self._relative, files_in(path))
        # To the engine braces are a pattern, and JSON is UTF-8: such files count as a part of the state.
        unnamed = [path for path in inputs if not _is_nameable(path)]
        state = [__version__, *(part for part in step.parts if isinstance(part, str))]
        state += [f"{ascii(path)} {_time_of(self.folder / path)}" for path in unnamed]
        need = needs.of(step)
        return GraphStep(
            rule=self._rules[step.name],
            inputs=[path for path in inputs if path not in unnamed],
            main_file=self._relative(step.main_file),
            receipt=self._relative(self._note(step, "receipt")),
            benchmark=self._relative(self._note(step, "tsv")),
            logs=[self._relative(self._log(step))] if self.is_logged else [],
            state=" ".join(state).translate(_NO_BRACES),
            threads=need.threads,
            memory_mb=need.memory_mb,
            minutes=need.minutes,
        )

    def _script(self, step: Step) -> str:
        """The command of a step, then the notes, or what a failure leaves."""

        def quoted(*words: str | Path) -> str:
            # Absolute: the engine runs it in the folder of results.
            return shlex.join(os.path.abspath(word) if isinstance(word, Path) else word for word in words)

        command = quoted(sys.executable, "-P", "-m", "bodycam_ros.cli.main", *step.stage.split(), *step.parts[1:])
        jobs = ' --jobs "$1"' if step.is_parallel else ""
        log = quoted(self._log(step))
        output, appended = (f" >{log} 2>&1", f" >>{log}") if self.is_logged else ("", " >&2")
        return f"""\
trap : TERM  # it reaches the command as well, which this shell waits for while it cleans up
code=0
{command}{jobs} </dev/null{output} || code=$?
if [ $code -ne 0 ] && [ $code -ne {WRONG_RESULT} ]; then
  if [ $code -gt 128 ]; then
    echo "{_ERROR}was killed by signal $((code - 128)); if memory was short, use fewer --jobs"{appended}
  fi
  rmdir {quoted(step.main_file.parent)} 2>/dev/null  # the engine has made it
  exit $code
fi
set -e
sha256sum <{quoted(step.main_file)} >{quoted(self._note(step, "sha256"))}
echo "$code $(date +%s%N)" >{quoted(self._note(step, "receipt"))}
"""

    def _note(self, step: Step, suffix: str) -> Path:
        return self.folder / NOTES / f"{self._file_name(step)}.{suffix}"

    def _log(self, step: Step) -> Path:
        return self.folder / "logs" / f"{self._file_name(step)}.log"

    def _file_name(self, step: Step) -> str:
        name, _, what = step.name.rpartition(": ")
        plain = _NOT_PLAIN.sub("_", name)[:_MAX_NAME]
        if plain != name:  # two may be the same then
            plain += f"-{hashlib.sha256(name.encode()).hexdigest()[:8]}"
        return "_".join([*([plain] if name else []), *what.split()])

    def _relative(self, path: Path) -> str:
        return os.path.relpath(os.path.abspath(path), self.folder)


def _is_nameable(path: str) -> bool:
    """Whether the engine takes a path for that of one file."""
    return "{" not in path and "}" not in path and path.isprintable()


def _time_of(path: Path) -> int:
    try:
        return path.stat().st_mtime_ns
    except OSError:
        return 0
