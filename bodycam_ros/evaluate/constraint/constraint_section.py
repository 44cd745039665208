"""The section of the report about what equipment does, and its part of ``summary.json``."""

from dataclasses import asdict
from typing import Any

import numpy as np

from bodycam_ros.evaluate.agreement.spread import Spread
from bodycam_ros.evaluate.comparison import Comparison
from bodycam_ros.evaluate.constraint.held_points import WithAndWithout
from bodycam_ros.evaluate.page.page import Block, Heading, Picture, Table, Text, number
from bodycam_ros.geometry import Array

CONSTRAINTS, HELD_WAYS = "constraints.png", "held_ways.png"
"""Files of the section's pictures."""


def constraint_section(both: WithAndWithout) -> tuple[Block, ...]:
    """What is said of both motions."""
    assert both.solved.equipment is not None
    rows = [
        (name, *(number(getattr(of, key)) for of in spreads for key in ("mean", "median", "max")))
        for name, spreads in _rows(both).items()
    ]
    return (
        Heading(f"With and without {both.solved.equipment.name}"),
        Text(
            f"{both.solved.path.name} beside {both.other.path.name}, at {len(both.stamps_ns)} instants. Distances are "
            "from where the equipment holds a point, which only the motion with it knows, to where each motion has it."
        ),
        Table(("", "with: mean", "median", "max", "without: mean", "median", "max"), rows),
        Picture(
            CONSTRAINTS,
            "With the constraints and without them (after B figures 9 and 12). A ring is where the equipment holds a "
            "point, a dot where the body has it; below, the distance between the two.",
        ),
        Picture(HELD_WAYS, "Ways of what is held, with the constraints and without them (B figure 10)."),
    )


def constraint_figures(both: WithAndWithout) -> dict[str, Any]:
    """Figures by name, the unit at the end of the name."""
    return {
        "with": both.solved.path.name,
        "without": both.other.path.name,
        "instants": len(both.stamps_ns),
        "measures": {
            name: {"with": asdict(spreads[0]), "without": asdict(spreads[1])} for name, spreads in _rows(both).items()
        },
    }


def _rows(both: WithAndWithout) -> dict[str, tuple[Spread, Spread]]:
    """Measure -> with and without."""
    rows: dict[str, tuple[Array, Array]] = {
        f"{point.name.replace('_', ' ')} [mm]": (1e3 * point.off_with, 1e3 * point.off_without) for point in both.points
    }
    if both.true_with is not None and both.true_without is not None:
        ours, other = both.true_with, both.true_without
        rows["joints against the truth [cm]"] = (100.0 * ours.position_errors, 100.0 * other.position_errors)
        rows["angles against the truth [deg]"] = (_angles_deg(ours), _angles_deg(other))
    return {name: (Spread.of(a), Spread.of(b)) for name, (a, b) in rows.items()}


def _angles_deg(comparison: Comparison) -> Array:
    angles: Array = np.degrees(np.array([joint.angle_errors for joint in comparison.joints.values()]))
    return angles
