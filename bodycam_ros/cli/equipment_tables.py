"""Tables of what a body was coupled to, for the terminal."""

from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from rich.table import Table

_MOST_STRETCHES = 3


def equipment_tables(figures: Mapping[str, Any]) -> Iterator[Table]:
    """A table of the attachments, and one of the lengths that were estimated, if any.

    Args:
        figures: of ``equipment_figures``; what is unknown may be None or NaN.
    """
    placed_s = figures["placed_from_s"]
    placed = "never placed" if placed_s is None else f"placed from {placed_s:.2f} s"
    table = Table(
        title=f"equipment {figures['name']}",
        caption=f"{placed}; held: share of the instants; mean, p95, max: distance between the points while it held; "
        "apart: while it did not, median",
    )
    table.add_column("attachment", no_wrap=True)
    for column in ("held", "mean [mm]", "p95 [mm]", "max [mm]", "apart [mm]", "let go [s]"):
        table.add_column(column, justify="right")
    for name, each in figures["attachments"].items():
        deviation = (_number(each["deviation_mm"][key]) for key in ("mean", "p95", "max"))
        apart = _number(each["apart_mm"]["median"])
        table.add_row(name, f"{each['held']:.1%}", *deviation, apart, _stretches(each["let_go_s"]))
    yield table
    if figures["lengths"]:
        table = Table(title="lengths of it that were unknown")
        table.add_column("length", no_wrap=True)
        for column in ("value [mm]", "+-"):
            table.add_column(column, justify="right")
        for name, length in figures["lengths"].items():
            table.add_row(name, _number(length["value_mm"]), _number(length["sigma_mm"]))
        yield table


def _stretches(stretches: Sequence[Sequence[float]]) -> str:
    told = [f"{start:.2f} to {end:.2f}" for start, end in stretches[:_MOST_STRETCHES]]
    more = len(stretches) - len(told)
    return ", ".join(told) + (f" and {more} more" if more else "")


def _number(value: float | None) -> str:
    # NaN alone differs from itself.
    return "" if value is None or value != value else f"{value:.1f}"
