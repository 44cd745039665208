"""The table that 'bodycam evaluate' prints of somebody who walks."""

from typing import TYPE_CHECKING

from rich.table import Table

if TYPE_CHECKING:
    from bodycam_ros.evaluate.walking.gait import Gait


def gait_table(gait: "Gait", true: "Gait | None") -> Table:
    """Means over strides, of both feet and of each, beside the truth."""
    from bodycam_ros.evaluate.walking.gait import SIDES
    from bodycam_ros.evaluate.walking.gait_section import gait_columns, gait_rows

    counts = ", ".join(f"{len(gait.of(side))} {side}" for side in SIDES)
    table = Table(title="walking", caption=f"strides: {counts}; symmetry: left less right over their mean")
    for number, column in enumerate(gait_columns(true)):
        table.add_column(column, justify="right" if number else "left", no_wrap=not number)
    for row in gait_rows(gait, true):
        table.add_row(*row)
    return table
