"""Runs cases, some at a time, each in a folder of its own."""

import os
import shutil
import time
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from faults.cases import Case
from faults.outcome import Outcome, Snapshot, judged, snapshot
from faults.run import Run
from faults.work import Work

_FRESH = 12
"""One of so many cases runs in a process that is started anew."""
_LOOK_S = 0.01


@dataclass
class Trial:
    """A case under way, or over."""

    case: Case
    run: Run
    before: Snapshot


def run_cases(
    cases: Sequence[Case], seed: int, stock: Path, folder: Path, jobs: int
) -> Iterator[tuple[Trial, Outcome]]:
    """Yield the cases as they end."""
    waiting, under_way = list(cases), list[Trial]()
    try:
        while waiting or under_way:
            while waiting and len(under_way) < jobs:
                under_way.append(_started(waiting.pop(0), seed, stock, folder))
            ended = [trial for trial in under_way if trial.run.is_over()]
            for trial in ended:
                under_way.remove(trial)
                yield trial, judged(trial.run, trial.before, stock)
                _remove(trial.run.folder)
            if not ended:
                time.sleep(_LOOK_S)
    finally:
        for trial in under_way:
            trial.run.end()


def _started(case: Case, seed: int, stock: Path, folder: Path) -> Trial:
    random = case.random(seed)
    work = Work(folder / "case" / f"{zlib.crc32(case.title.encode()):08x}", stock)
    work.folder.mkdir(parents=True)
    attempt = case.make(work, random)
    fresh = attempt.stop is not None or int(random.integers(_FRESH)) == 0
    before = snapshot(work.folder)
    return Trial(case, Run.started(attempt, work.folder, fresh), before)


def _remove(folder: Path) -> None:
    for parent, folders, _ in os.walk(folder):
        for name in folders:
            path = Path(parent) / name
            if not path.is_symlink():
                path.chmod(0o755)
    shutil.rmtree(folder)
