"""What the campaign found, by kind."""

import sys
from collections import defaultdict
from collections.abc import Sequence

from faults.cases import Case
from faults.outcome import FAULTS, NAMED, SURVIVED, Outcome
from rich.console import Console
from rich.table import Table
from rich.text import Text

_SOME = 3
"""Cases; of fewer, all may be those in which there is nothing to be opened."""


def by_kind(results: Sequence[tuple[Case, Outcome]]) -> Table:
    """Tried, those whose damaged input was opened, survived, named, and every sort of fault."""
    table = Table("kind", title="corrupted inputs")
    for column in ("tried", "reached", SURVIVED, NAMED, *FAULTS, "most memory [MB]"):
        table.add_column(column, justify="right")
    rows = defaultdict(list)
    for case, outcome in results:
        rows[case.kind].append(outcome)
        rows["all"].append(outcome)
    rows["all"] = rows.pop("all", [])
    for kind, outcomes in rows.items():
        good = [sum(outcome.result == result for outcome in outcomes) for result in (SURVIVED, NAMED)]
        faulty = [sum(fault in outcome.faults for outcome in outcomes) for fault in FAULTS]
        memory = max((outcome.memory_mb for outcome in outcomes), default=0.0)
        reached = sum(any(outcome.inputs.values()) for outcome in outcomes) if any(o.inputs for o in outcomes) else "-"
        figures = (len(outcomes), reached, *good, *(count or "" for count in faulty), round(memory))
        table.add_row(kind, *map(str, figures), style="red" if any(faulty) else None, end_section=False)
    return table


def unreached(results: Sequence[tuple[Case, Outcome]]) -> list[Text]:
    """Kinds of damage to an input that were tried some times, and of which no run opened the input."""
    opened = defaultdict(list)
    for case, outcome in results:
        for name, was_opened in outcome.inputs.items():
            opened[case.kind, name].append(was_opened)
    return [
        Text(f"{kind}: none of {len(each)} cases with a damaged {name} reached what reads it")
        for (kind, name), each in opened.items()
        if len(each) >= _SOME and not any(each)
    ]


def failures(case: Case, outcome: Outcome, seed: int) -> list[Text]:
    """What failed, and the command line that repeats it."""
    again = f"{sys.executable} test/faults --seed {seed} --case '{case.title}'"
    plain = {fault: what.encode("ascii", "backslashreplace").decode() for fault, what in outcome.faults.items()}
    return [Text(f"{fault}: {what}\n    {again}") for fault, what in plain.items()]


def on_paper() -> Console:
    """Standard output, wide enough where nobody knows its width."""
    console = Console(soft_wrap=True, highlight=False)
    if not console.is_terminal:
        console.width = max(console.width, 150)
    return console
