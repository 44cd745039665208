"""Tables of an evaluation's figures, and the verdict, on the terminal."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from rich.table import Table
from rich.text import Text

from bodycam_ros.terminal import Terminal
from bodycam_ros.verdict import Level, Verdict

if TYPE_CHECKING:
    from bodycam_ros.evaluate.gait import Gait

Rows = Mapping[str, Mapping[str, Any]]


@dataclass(frozen=True)
class FigureTable:
    """A table whose rows are figures by name.

    Attributes:
        heading: of the column with the names.
        columns: heading, path of the figure ("image_motion_px.p95") and format of each; one without figures is left
            out.
    """

    title: str
    heading: str
    columns: Sequence[tuple[str, str, str]]
    caption: str | None = None

    def fill(self, rows: Rows, styles: Mapping[str, str | None] | None = None) -> Table:
        """The table of some rows; figures that are None or NaN are empty cells."""
        table = Table(title=self.title, caption=self.caption)
        table.add_column(self.heading, no_wrap=True)
        columns = [[_cell(row, path, form) for row in rows.values()] for _, path, form in self.columns]
        shown = [index for index, cells in enumerate(columns) if any(cells)]
        for index in shown:
            table.add_column(self.columns[index][0], justify="right")
        for number, name in enumerate(rows):
            table.add_row(name, *(columns[index][number] for index in shown), style=(styles or {}).get(name))
        return table


def _cell(row: Mapping[str, Any], path: str, form: str) -> str:
    value: Any = row
    for key in path.split("."):
        value = value.get(key) if isinstance(value, Mapping) else None
    if value is None or value != value:
        return ""
    return value if isinstance(value, str) else f"{value:{form}}"


_CAMERAS = FigureTable(
    "cameras",
    "camera",
    (
        ("images", "images", "d"),
        ("registered", "registered", ".1%"),
        ("lost [s]", "longest_lost_s", ".2f"),
        ("tracks", "tracks", ".0f"),
        ("landmarks", "landmarks", ".0f"),
        ("motion [px]", "image_motion_px.p95", ".1f"),
        ("gap [mm]", "position_gap_mm.median", ".1f"),
        ("gap [deg]", "rotation_gap_deg.median", ".2f"),
        ("error [px]", "reprojection_px.median", ".2f"),
        ("light", "brightness.range", ".2f"),
    ),
    "lost: the longest time without a pose; motion: of the picture from image to image, 95th percentile; gap: from the "
    "registered to the solved pose, median; error: of landmarks in the solved pose, median; light: brightest over "
    "darkest",
)
_STATIONS = FigureTable(
    "static cameras",
    "camera",
    (
        ("images", "images", "d"),
        ("observed", "seen", ".1%"),
        ("segments", "segments", ".1f"),
        ("confidence", "confidence", ".1%"),
    ),
    "observed: share of the images that measure a segment's pose; confidence: share of the contour that does",
)
_CLOCKS = FigureTable(
    "clocks",
    "camera",
    (
        ("offset [ms]", "clock.ahead_ms", ".1f"),
        ("+-", "clock.ahead_sigma_ms", ".1f"),
        ("drift [ppm]", "clock.drift_ppm", ".0f"),
        ("+-", "clock.drift_sigma_ppm", ".0f"),
        ("set at [s]", "clock.set", ""),
        ("read-out [ms]", "clock.readout_ms", ".2f"),
        ("+-", "clock.readout_sigma_ms", ".2f"),
    ),
    "offset: ahead of the recording's time (+) or behind, corrected; the last one if the clock was set",
)
_SPREAD = (("mean", "mean", ".3f"), ("median", "median", ".3f"), ("p95", "p95", ".3f"), ("max", "max", ".3f"))
_SLIDING = FigureTable(
    "sliding of feet in stance",
    "foot",
    (
        ("stances", "stances", "d"),
        ("stance [s]", "standing_s", ".2f"),
        ("mean [mm]", "mean_mm", ".2f"),
        ("max [mm]", "max_mm", ".2f"),
        ("path [mm]", "way_mm", ".2f"),
    ),
    "horizontal distance of heel or ball from its mean position in a stance; path: its length in a stance",
)
_CONSTRAINTS = FigureTable(
    "with and without equipment",
    "",
    (
        ("with: mean", "with.mean", ".2f"),
        ("max", "with.max", ".2f"),
        ("without: mean", "without.mean", ".2f"),
        ("max", "without.max", ".2f"),
    ),
    "distance from where the equipment holds a point",
)
_ATTACHMENTS = (
    ("active", "held", ".1%"),
    ("mean [mm]", "deviation_mm.mean", ".1f"),
    ("p95 [mm]", "deviation_mm.p95", ".1f"),
    ("max [mm]", "deviation_mm.max", ".1f"),
    ("apart [mm]", "apart_mm.median", ".1f"),
    ("released [s]", "released", ""),
)
_LENGTHS = FigureTable(
    "estimated lengths of the equipment", "length", (("value [mm]", "value_mm", ".1f"), ("+-", "sigma_mm", ".1f"))
)
_JOINTS = FigureTable(
    "joints against the truth, mean",
    "segment",
    (
        ("position [cm]", "position_cm", ".3f"),
        ("angle [deg]", "angle_deg", ".3f"),
        ("rotation [deg]", "rotation_deg", ".3f"),
    ),
)
_AGREEMENT = tuple((name, name, ".2f") for name in ("mean", "median", "sd", "min", "max"))
_MAX_STRETCHES = 3


def figure_tables(figures: Mapping[str, Any], verdict: Verdict) -> Iterator[Table]:
    """Tables of the figures of ``evaluate.summary``, those of cameras coloured by the verdict."""
    if cameras := figures["cameras"]:
        unregistered = {name: None if camera["registered"] > 0.0 else "red" for name, camera in cameras.items()}
        yield _CAMERAS.fill(cameras, unregistered | camera_styles(verdict))
    if stations := figures.get("stations"):
        yield _STATIONS.fill(stations, {name: None if each["seen"] else "red" for name, each in stations.items()})
    clocks = {name: dict(camera["clock"]) for name, camera in cameras.items() if camera.get("clock") is not None}
    if clocks:
        for clock in clocks.values():
            clock["set"] = " ".join(f"{seconds:.1f}" for seconds in clock["held_from_s"])
        styles = {name: "bold" if clock["is_off"] else None for name, clock in clocks.items()}
        yield _CLOCKS.fill({name: {"clock": clock} for name, clock in clocks.items()}, styles)
    body = ("root_position_sigma_mm", "root_rotation_sigma_deg", "jitter_mm")
    yield FigureTable("body", "measure", _SPREAD).fill({_words(name): figures[name] for name in body})
    if "equipment" in figures:
        yield from equipment_tables(figures["equipment"])
    if figures["sliding"].get("all", {"stances": 0})["stances"]:
        yield _SLIDING.fill(_sliding_rows(figures))
    if "truth" in figures:
        truth = figures["truth"]
        yield _JOINTS.fill(truth["per_joint"])
        errors = ("position_cm", "sim_position_cm", "angle_deg", "rotation_deg")
        rows = {_words(name).replace("sim position", "position, scale fitted"): truth[name] for name in errors}
        yield FigureTable("against the truth", "measure", _SPREAD).fill(rows)
    elif "agreement" in figures:
        yield _agreement_table(figures["agreement"])
    if "constraints" in figures:
        yield _CONSTRAINTS.fill(figures["constraints"]["measures"])


def _words(name: str) -> str:
    what, _, unit = name.rpartition("_")
    return f"{what.replace('_', ' ')} [{unit}]"


def _sliding_rows(figures: Mapping[str, Any]) -> Rows:
    rows = dict(figures["sliding"])
    for foot, against in figures.get("sliding_against_truth", {}).items():
        rows[f"{foot}, in the true stances"] = against["solved"]
        rows[f"{foot}, the true one"] = against["true"]
        rows[f"{foot}, beyond the true one"] = against["beyond"]
    return rows


def _agreement_table(agreement: Mapping[str, Any]) -> Table:
    """Errors as the paper states them; the report has those per plane."""
    rows = {"joint position [cm]": agreement["position_cm"], "joint angle [deg]": agreement["angle_deg"]}
    rows |= {f"{name} [cm]": point["position_cm"] for name, point in agreement["points"].items()}
    caption = "per joint and plane, with pictures, in report.html"
    table = FigureTable(f"against {agreement['with']}", "error", _AGREEMENT, caption)
    return table.fill({name: spread for name, spread in rows.items() if spread is not None})


def equipment_tables(figures: Mapping[str, Any]) -> Iterator[Table]:
    """A table of the attachments, and one of the lengths that were estimated, if any.

    Args:
        figures: of ``equipment_figures``.
    """
    placed_s = figures["placed_from_s"]
    placed = "never placed" if placed_s is None else f"placed from {placed_s:.2f} s"
    caption = (
        f"{placed}; active: share of the frames; mean, p95, max: distance of the points while active; apart: while "
        "released, median"
    )
    rows = {name: {**each, "released": _stretches(each["let_go_s"])} for name, each in figures["attachments"].items()}
    yield FigureTable(f"equipment {figures['name']}", "attachment", _ATTACHMENTS, caption).fill(rows)
    if figures["lengths"]:
        yield _LENGTHS.fill(figures["lengths"])


def _stretches(stretches: Sequence[Sequence[float]]) -> str:
    shown = [f"{start:.2f} to {end:.2f}" for start, end in stretches[:_MAX_STRETCHES]]
    more = len(stretches) - len(shown)
    return ", ".join(shown) + (f" and {more} more" if more else "")


def gait_table(gait: "Gait", true: "Gait | None") -> Table:
    """Means over strides, of both feet and of each, beside the truth."""
    from bodycam_ros.evaluate.gait import SIDES
    from bodycam_ros.evaluate.gait_section import gait_columns, gait_rows

    counts = ", ".join(f"{len(gait.of(side))} {side}" for side in SIDES)
    table = Table(title="walking", caption=f"strides: {counts}; symmetry: left less right over their mean")
    for number, column in enumerate(gait_columns(true)):
        table.add_column(column, justify="right" if number else "left", no_wrap=not number)
    for row in gait_rows(gait, true):
        table.add_row(*row)
    return table


WRONG_RESULT = 3
"""Exit code when there is a result that should not be used; it is written all the same."""

_STYLES = {Level.GOOD: "green", Level.DOUBTFUL: "yellow", Level.WRONG: "bold red"}


def print_verdict(terminal: Terminal, verdict: Verdict) -> None:
    """Print a line for each finding and the verdict."""
    for finding in verdict.findings:
        line = Text.assemble((f"{finding.level.word}: ", _STYLES[finding.level]), finding.text)
        terminal.print(line, soft_wrap=True)
    terminal.print(Text(f"verdict: {verdict.text}", _STYLES[verdict.level]), soft_wrap=True)


def camera_styles(verdict: Verdict) -> dict[str, str]:
    """Camera with a finding -> the style of its row in a table."""
    # The worst comes first and stays.
    return {finding.subject: _STYLES[finding.level] for finding in reversed(verdict.findings)}


def exit_code(verdict: Verdict) -> int:
    """0, or that of a result that should not be used."""
    return WRONG_RESULT if verdict.level is Level.WRONG else 0
