"""Breaks everything that a user can give, and counts what comes of it."""

import argparse
import os
import shutil
import tempfile
from collections.abc import Iterator
from pathlib import Path

from faults.cases import INTACT, KINDS, Case, chosen, named
from faults.outcome import Outcome, snapshot
from faults.run import warm_up
from faults.table import by_kind, failures, on_paper, unreached
from faults.trials import Trial, run_cases
from faults.work import make_stock
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

_SHORT = 30
"""Cases of the short form."""


def main() -> int:
    """Run the campaign; 1 if there is a fault, or if cases proved nothing; else 0."""
    arguments = _arguments()
    cases = _cases(arguments)
    if arguments.list:
        print("\n".join(case.title for case in cases))
        return 0
    # No TemporaryDirectory: the cases are forked from this process, and the first that ends would remove it.
    folder = Path(tempfile.mkdtemp(prefix="bodycam_faults."))
    try:
        results = _all_run(cases, folder, arguments)
    finally:
        shutil.rmtree(folder)
    on_paper().print(by_kind(results))
    for line in (in_vain := unreached(results)):
        on_paper().print(line)
    return int(bool(in_vain) or any(outcome.faults for _, outcome in results))


def _arguments() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="test/faults", description=__doc__)
    parser.add_argument("--seed", type=int, default=1, help="of all random numbers (default: %(default)s)")
    parser.add_argument("--cases", type=int, help="how many (default: each damage once)")
    parser.add_argument("--only", action="append", choices=KINDS, help="this kind; repeatable")
    parser.add_argument("--case", metavar="TITLE", help="this case alone, and show what it printed")
    parser.add_argument("--list", action="store_true", help="list the cases, and run nothing")
    parser.add_argument("--jobs", type=int, default=os.cpu_count() or 1, help="at a time (default: %(default)s)")
    parser.add_argument("--short", action="store_true", help="a minute's worth of it, for the tests")
    return parser.parse_args()


def _cases(arguments: argparse.Namespace) -> list[Case]:
    if arguments.case:
        return [named(arguments.case)]
    kinds = frozenset(arguments.only or KINDS) & KINDS.keys() - {INTACT}
    count = _SHORT if arguments.short else arguments.cases
    damaged = list(chosen(count, arguments.seed, kinds)) if kinds else []
    return [*chosen(None, arguments.seed, frozenset({INTACT})), *damaged]


def _all_run(cases: list[Case], folder: Path, arguments: argparse.Namespace) -> list[tuple[Case, Outcome]]:
    columns = (BarColumn(), MofNCompleteColumn(), TimeElapsedColumn(), TextColumn("{task.description}"))
    results: list[tuple[Case, Outcome]] = []
    # No thread that draws: the cases are forked from this process.
    with Progress(*columns, console=on_paper(), transient=True, auto_refresh=False) as progress:
        task = progress.add_task("making good inputs", total=len(cases))
        progress.refresh()
        warm_up()
        stock = folder / "stock"
        stock.mkdir()
        make_stock(stock)
        untouched = snapshot(stock)
        for trial, outcome in _good_ones_first(cases, arguments, stock, folder):
            results.append((trial.case, outcome))
            for fault in failures(trial.case, outcome, arguments.seed):
                progress.console.print(fault)
            faulty = sum(bool(outcome.faults) for _, outcome in results)
            progress.update(task, advance=1, description=f"{faulty} faulty; {trial.case.title}", refresh=True)
            if arguments.case:
                _show(trial.run.attempt.arguments, trial.run.printed, outcome)
        if snapshot(stock) != untouched:
            raise RuntimeError("a command changed a file that it was given as input, outside of its case's folder")
    return results


def _good_ones_first(
    cases: list[Case], arguments: argparse.Namespace, stock: Path, folder: Path
) -> Iterator[tuple[Trial, Outcome]]:
    """Run the intact cases, then the others: where good input is refused, damaged input proves nothing."""
    intact, damaged = ([case for case in cases if (case.kind == INTACT) == good] for good in (True, False))
    is_good = True
    for trial, outcome in run_cases(intact, arguments.seed, stock, folder, arguments.jobs):
        is_good = is_good and not outcome.faults
        yield trial, outcome
    if is_good:
        yield from run_cases(damaged, arguments.seed, stock, folder, arguments.jobs)


def _show(command: tuple[str, ...], printed: bytes, outcome: Outcome) -> None:
    print(ascii(" ".join(("bodycam", *command))))
    print(printed.decode("utf-8", "backslashreplace"))
    print(outcome)
