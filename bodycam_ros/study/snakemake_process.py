"""Runs Snakemake on a study's folder, as a process, and tells what its jobs do."""

import importlib.util
import os
import re
import signal
import subprocess
import sys
from collections import deque
from collections.abc import Generator, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from bodycam_ros.errors import StudyError
from bodycam_ros.study.workflow_folder import SNAKEFILE
from bodycam_ros.whole_file import write_whole

_BEGUN = re.compile(r"Job (\d+): (.+)")
_ENDED = re.compile(r"Finished jobid: (\d+)")
_COUNTED = re.compile(r"total\s+(\d+)")
_FAILED = re.compile(r"Error in rule \w+")
_JOB_ID = re.compile(r"\s+jobid: (\d+)")

_PATIENCE_S = 60.0
"""How long jobs may clean up after an interruption before they are killed: a replay takes some two, a cluster's jobs
are only asked for when Snakemake looks at them next, up to 40 later."""

_LINES_KEPT = 20

_PROFILE = "SNAKEMAKE_PROFILE"
"""Variable that would send the jobs elsewhere than the command says."""


@dataclass(frozen=True)
class JobNews:
    """What became of a job.

    Attributes:
        name: of the step.
        state: that it has now.
    """

    name: str
    state: Literal["begun", "done", "failed"]


@dataclass
class SnakemakeProcess:
    """Snakemake on one folder.

    Attributes:
        folder: of the study.
        words: how it is to run: cores, profile.
        lock: descriptor that is passed on to it.
        jobs: how many it has found that are to be run.
        has_failed: whether a job did.
        said: the last lines of it.
    """

    folder: Path
    words: Sequence[str]
    lock: int
    jobs: int = 0
    has_failed: bool = False
    said: deque[str] = field(default_factory=lambda: deque(maxlen=_LINES_KEPT))

    def unlock(self) -> None:
        """Remove the lock that a killed Snakemake left.

        Raises:
            StudyError: that is not possible.
        """
        done = subprocess.run(
            [*self._command(), "--unlock"], cwd=self.folder, capture_output=True, text=True, check=False
        )
        if done.returncode:
            raise StudyError(f"{self.folder}: cannot be unlocked: {_last_line(done.stderr.splitlines())}")

    def run(self, dry: bool = False) -> Generator[JobNews, None, None]:
        """Run all jobs that are not done; a failed one keeps only those from running that need it.

        Whoever iterates must close it, whatever happens: so all jobs end at Ctrl-C.

        Args:
            dry: only say which would begin.

        Raises:
            StudyError: the workflow as such could not be run.
        """
        words = [*self._command(), *self.words]
        words += ["--keep-going", "--rerun-incomplete", "--scheduler", "greedy", "--nocolor"]
        words += ["--dry-run"] if dry else []
        # A session of its own: a terminal's Ctrl-C reaches it through us, once, and with it all jobs.
        with subprocess.Popen(
            words,
            cwd=self.folder,
            env={name: value for name, value in os.environ.items() if name != _PROFILE},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            errors="backslashreplace",
            pass_fds=(self.lock,),
            start_new_session=True,
        ) as process:
            try:
                yield from self._news(process)
                code = process.wait()
            finally:
                self._end(process)
        if code < 0:
            raise StudyError(f"{self.folder}: Snakemake was killed (signal {-code}); the next run goes on")
        if code and not self.has_failed:
            raise StudyError(f"{self.folder}: Snakemake could not run the workflow: {_last_line(self.said)}")

    def _command(self) -> list[str]:
        return [sys.executable, "-m", "snakemake", "--directory", str(self.folder), "--snakefile", SNAKEFILE]

    def _news(self, process: "subprocess.Popen[str]") -> Iterator[JobNews]:
        """What the lines say that Snakemake prints: of each job its name when it begins, later its number."""
        names: dict[str, str] = {}
        failed: set[str] = set()
        of_failure = False
        for line in process.stdout or ():
            self.said.append(line.rstrip())
            if counted := _COUNTED.match(line):
                self.jobs = int(counted[1]) - 1  # one of them asks for all others, and does nothing
            elif begun := _BEGUN.fullmatch(line.rstrip()):
                names[begun[1]] = begun[2]
                yield JobNews(begun[2], "begun")
            elif ended := _ENDED.match(line):
                if ended[1] in names:
                    yield JobNews(names[ended[1]], "done")
            elif _FAILED.match(line):
                of_failure = self.has_failed = True
            elif of_failure and (job := _JOB_ID.match(line)):
                of_failure = False
                if job[1] in names and job[1] not in failed:  # it is said again at the end
                    failed.add(job[1])
                    yield JobNews(names[job[1]], "failed")

    def _end(self, process: "subprocess.Popen[str]") -> None:
        """Let no job outlive it, neither where we are interrupted nor where it was killed."""
        was_killed = (process.poll() or 0) < 0
        if process.returncode is not None and not was_killed:
            return
        for number in (signal.SIGTERM,) if was_killed else (signal.SIGINT, signal.SIGTERM, signal.SIGKILL):
            try:
                os.killpg(process.pid, number)
                process.wait(_PATIENCE_S)
                return
            except ProcessLookupError:
                return
            except subprocess.TimeoutExpired:
                continue


def check_snakemake(plugin: str | None = None) -> None:
    """Refuse to go on without Snakemake.

    Args:
        plugin: package that is needed besides.

    Raises:
        StudyError: it is not installed; the message says what to install.
    """
    for module, extra in (("snakemake", "study"), *([(plugin, "slurm")] if plugin else [])):
        if importlib.util.find_spec(module) is None:
            raise StudyError(
                f"this needs {module.replace('_', '-')}, which is not installed: pip install 'bodycam_ros[{extra}]', "
                "or in the folder of the sources make test"
            )


def _last_line(lines: Sequence[str] | deque[str]) -> str:
    return next((line.strip() for line in reversed(lines) if line.strip()), "it said nothing")


SLURM = "slurm"
_FILE = "config.yaml"
_CLUSTER_PROFILE = """\
# How 'bodycam study --profile slurm' asks the cluster; written once, change it as you like.
# https://snakemake.github.io/snakemake-plugin-catalog/plugins/executor/slurm.html explains what else there is.
executor: slurm
jobs: 100               # in the queue at a time
latency-wait: 60        # seconds until a file that a job wrote must be seen on this machine
# default-resources:    # what the cluster wants to know of every job
#   slurm_account: ACCOUNT
#   slurm_partition: PARTITION
#   runtime: 120        # minutes
"""


def profile_folder(name: str, folder: Path) -> Path:
    """The folder of a profile; that for Slurm is made in the folder of the study, if it is not there.

    Args:
        name: ``slurm``, or the path of a profile.
        folder: of the study.

    Raises:
        StudyError: there is no such profile.
    """
    if name == SLURM:
        profile = folder / "profiles" / SLURM
        if not (profile / _FILE).exists():
            profile.mkdir(parents=True, exist_ok=True)
            write_whole(profile / _FILE, _CLUSTER_PROFILE)
        return profile
    given = Path(name).absolute()
    if not any(given.glob("config*.yaml")):
        raise StudyError(f"--profile {name}: is neither {SLURM} nor a folder with a Snakemake profile ({_FILE})")
    return given
