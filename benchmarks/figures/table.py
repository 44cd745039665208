"""The figures as JSON, on the terminal beside the run before, and as the page docs/figures.md."""

import json
import math
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path

from rich.table import Table
from rich.text import Text

from benchmarks.figures.figure import Figure, Limit, Value


@dataclass(frozen=True)
class Run:
    """One run of the table.

    Attributes:
        commit: short hash, with + where the tree had changes.
        mode: ``full``, ``quick`` or ``sample``; runs of different modes have different rows.
        cores, load: of the machine, and its load average when the run began.
        seconds: that it took [s].
        figures: name -> value.
    """

    commit: str
    mode: str
    cores: int
    load: float
    seconds: float
    figures: dict[str, Value]

    def write(self, path: Path) -> None:
        """Write as JSON; NaN as null."""
        values = {n: None if isinstance(v, float) and math.isnan(v) else v for n, v in self.figures.items()}
        path.write_text(json.dumps(asdict(self) | {"figures": values}, indent=1) + "\n")


def read_run(path: Path) -> Run | None:
    """A run that was written before; None where there is none."""
    if not path.is_file():
        return None
    document = json.loads(path.read_text())
    figures = {n: float("nan") if v is None else v for n, v in document.pop("figures").items()}
    return Run(figures=figures, **document)


def broken(figures: Sequence[Figure], limits: Mapping[str, Limit]) -> list[str]:
    """Names of figures that break their limit or have none."""
    return [f.name for f in figures if f.name not in limits or not limits[f.name].is_held_by(f.value)]


def shown(run: Run, before: Run | None, limits: Mapping[str, Limit]) -> Table:
    """The table for a terminal: figure, value, limit, and how the run before differs."""
    table = Table("figure", "value", "limit", "before", "difference", title=_title(run))
    for name, value in run.figures.items():
        limit, old = limits.get(name), before.figures.get(name) if before else None
        held = limit is not None and limit.is_held_by(value)
        table.add_row(
            Text(name),
            Text(_written(value), "green" if held else "bold red"),
            str(limit or "none"),
            "" if old is None else _written(old),
            "" if old is None else _difference(value, old, limit),
        )
    return table


def page(run: Run, limits: Mapping[str, Limit]) -> str:
    """The page docs/figures.md."""
    lines = [
        "# Figures",
        "",
        "Made by `make figures`; do not edit. A value beyond its limit (`benchmarks/figures/limits.yaml`) is a",
        "regression to repair.",
        "*Noise* is how far two runs of the same code differ on a shared machine, as a share of the value.",
        "",
        f"Commit {run.commit}, {run.cores} cores, load {run.load:.1f} at the start, {run.seconds / 60.0:.0f} min.",
    ]
    for group, names in groupby(run.figures, key=lambda name: name.partition(": ")[0]):
        lines += ["", f"## {group}", "", "| figure | value | limit | noise |", "|---|---|---|---|"]
        for name in names:
            limit = limits.get(name)
            noise = f"{100.0 * limit.noise:g} %" if limit and limit.noise else ""
            lines.append(f"| {name.partition(': ')[2]} | {_written(run.figures[name])} | {limit or 'none'} | {noise} |")
    return "\n".join(lines) + "\n"


def _title(run: Run) -> str:
    return f"{run.mode}: commit {run.commit}, {run.cores} cores, load {run.load:.1f}, {run.seconds / 60.0:.1f} min"


def _written(value: Value) -> str:
    if isinstance(value, str):
        return value
    return "failed" if math.isnan(value) else f"{value:.4g}"


def _difference(value: Value, old: Value, limit: Limit | None) -> Text:
    if isinstance(value, str) or isinstance(old, str) or math.isnan(value) or math.isnan(old) or not old:
        return Text("", "") if value == old else Text("other", "bold red")
    share = value / old - 1.0
    if abs(share) <= (limit.noise if limit else 0.0):
        return Text(f"{100.0 * share:+.1f} %", "dim")
    better = limit is not None and (share < 0.0) == (limit.sign == "<=")
    return Text(f"{100.0 * share:+.1f} %", "green" if better else "red")
