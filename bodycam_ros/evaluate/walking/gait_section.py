"""The section of the report about walking."""

from collections.abc import Sequence

from bodycam_ros.evaluate.page.page import Block, Heading, Picture, Table, Text, number
from bodycam_ros.evaluate.walking.gait import CRITERION, SIDES, Gait
from bodycam_ros.evaluate.walking.gait_figures import MEASURES, Told, symmetry_index

GAIT = "gait.png"
"""File of the section's picture."""


def gait_section(gait: Gait, true: Gait | None) -> tuple[Block, ...]:
    """What is said of a gait, with the true one beside it if that is known."""
    counts = " and ".join(f"{len(gait.of(side))} of the {side} foot" for side in SIDES)
    return (
        Heading("Walking"),
        Text(
            f"Means and standard deviations over {counts}. A stride goes from where the heel is furthest ahead of the "
            "pelvis to where it is so again, its swing from where the ball is furthest behind (Zeni 2008). Heel and "
            "ball are two points of the sole, as deep and as long as the shin tells. Symmetry: left less right over "
            "their mean."
        ),
        Text(f"What counts as walking: {CRITERION}."),
        Table(gait_columns(true), gait_rows(gait, true)),
        Picture(
            GAIT, "Heights of heel and ball, with stances, and flexion over the stride: mean and standard deviation."
        ),
    )


def gait_columns(true: Gait | None) -> Sequence[str]:
    """Headings of ``gait_rows``."""
    return ("measure", "all", "+-", *SIDES, "symmetry [%]", *(("truth", "off") if true is not None else ()))


def gait_rows(gait: Gait, true: Gait | None) -> list[tuple[str, ...]]:
    """A row of cells per measure."""
    rows = []
    for measure in MEASURES:
        of_all = Told.of(gait.strides, measure)
        sides = (number(Told.of(gait.of(side), measure).mean, measure.decimals) for side in SIDES)
        symmetry = number(symmetry_index(gait, measure), 1, signed=True) if measure.is_symmetric else ""
        row = (
            measure.name, number(of_all.mean, measure.decimals), number(of_all.sd, measure.decimals), *sides, symmetry
        )  # fmt: skip
        if true is not None:
            truly = Told.of(true.strides, measure).mean
            off = number(of_all.mean - truly, measure.decimals, signed=True)
            row = (*row, number(truly, measure.decimals), off)
        rows.append(row)
    return rows
