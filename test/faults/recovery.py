"""How a node came back after it was killed. Needs no ROS."""

from dataclasses import dataclass

from rich.table import Table

AIM_S = 2.0
"""Within which joint states are to resume after a node has returned."""


@dataclass(frozen=True)
class Recovery:
    """What one kill led to.

    Attributes:
        node: name.
        back_s: from the kill until the node, started again at once, takes part in the graph.
        recovered_s: from then until what it makes is there again: registered landmarks, joint states.
        silent_s: the longest time without a joint state.
        fault: what went wrong; empty if nothing did.
    """

    node: str
    back_s: float = 0.0
    recovered_s: float = 0.0
    silent_s: float = 0.0
    fault: str = ""


def recovery_table(recoveries: list[Recovery]) -> Table:
    """By node."""
    table = Table("node", title="killed nodes (SIGKILL), started again at once")
    for column in (
        "kills",
        "back after [s]",
        "recovered after return [s]",
        "worst",
        "joint states silent [s]",
        "faults",
    ):
        table.add_column(column, justify="right")
    for name in dict.fromkeys(recovery.node for recovery in recoveries):
        of = [recovery for recovery in recoveries if recovery.node == name]
        good = [recovery for recovery in of if not recovery.fault]
        spans = sorted(recovery.recovered_s for recovery in good) or [float("nan")]
        back_s = max((recovery.back_s for recovery in good), default=float("nan"))
        silent_s = max((recovery.silent_s for recovery in good), default=float("nan"))
        figures = (f"{back_s:.1f}", f"{spans[len(spans) // 2]:.2f}", f"{spans[-1]:.2f}", f"{silent_s:.1f}")
        faults = len(of) - len(good)
        style = "red" if faults else "yellow" if not spans[-1] <= AIM_S else None
        table.add_row(name, str(len(of)), *figures, str(faults or ""), style=style)
    return table
