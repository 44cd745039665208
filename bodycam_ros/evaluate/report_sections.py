"""The tables of a report, by the figures of ``summary``: for page and terminal alike."""

from collections.abc import Iterator, Mapping, Sequence, Set
from dataclasses import dataclass
from typing import Any

from bodycam_ros.evaluate.gait import CRITERION
from bodycam_ros.evaluate.gait_figures import MEASURES
from bodycam_ros.evaluate.page import Section, Table

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

    def fill(self, rows: Rows, flagged: Set[str] = frozenset()) -> Section:
        """The section of some rows; figures that are None or NaN are empty cells, rows of some names are flagged."""
        columns = [[_cell(row, path, form) for row in rows.values()] for _, path, form in self.columns]
        shown = [index for index, cells in enumerate(columns) if any(cells)]
        cells = [(name, *(columns[index][row] for index in shown)) for row, name in enumerate(rows)]
        marked = frozenset(row for row, name in enumerate(rows) if name in flagged)
        headings = (self.heading, *(self.columns[index][0] for index in shown))
        notes = (self.caption,) if self.caption else ()
        return Section(self.title, notes, table=Table(headings, cells, flagged=marked))


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
    ),
    "lost: the longest time without a pose; motion: of the picture from image to image, 95th percentile; gap: from the "
    "registered to the solved pose, median; error: of landmarks in the solved pose, median",
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
_PLANES = FigureTable(
    "joint angles by anatomical plane",
    "joint, plane",
    (
        ("error, mean [deg]", "error_deg.mean", ".2f"),
        ("max", "error_deg.max", ".2f"),
        ("bias", "bias", "+.2f"),
        ("95 % from", "low", "+.2f"),
        ("to", "high", "+.2f"),
        ("rmse", "rmse", ".2f"),
    ),
    "bias and 95 % of the differences, ours less theirs (Bland and Altman 1986); where both have rotations of bones, "
    "two constant rotations per joint are fitted, for the axes of a bone are a convention",
)
_GAIT = (
    ("mean", "mean", ".3g"),
    ("sd", "sd", ".2g"),
    ("left", "left", ".3g"),
    ("right", "right", ".3g"),
    ("symmetry [%]", "symmetry_percent", "+.1f"),
    ("truth", "true", ".3g"),
)
_MAX_STRETCHES = 3


def report_sections(figures: Mapping[str, Any]) -> Iterator[Section]:
    """Sections with a table each, of the figures of ``summary``."""
    faulty = {finding["subject"] for finding in figures["verdict"]["findings"]}
    if "truth" in figures:
        truth = figures["truth"]
        caption = (
            f"positions after one rigid alignment; coverage {truth['coverage']:.1%}, scale {truth['scale']:.5f}, tilt "
            f"{truth['tilt_deg']:.3f} deg"
        )
        if truth["links_missing"]:
            caption += f"; in the truth, but not in the body: {', '.join(truth['links_missing'])}"
        errors = ("position_cm", "sim_position_cm", "angle_deg", "rotation_deg")
        rows = {_words(name).replace("sim position", "position, scale fitted"): truth[name] for name in errors}
        yield FigureTable("against the truth", "measure", _SPREAD, caption).fill(rows)
        yield _JOINTS.fill(truth["per_joint"])
    if "agreement" in figures:
        yield from _agreement_sections(figures["agreement"])
    if "constraints" in figures:
        yield _CONSTRAINTS.fill(figures["constraints"]["measures"])
    cameras = figures["cameras"]
    if cameras:
        lost = {name for name, camera in cameras.items() if not camera["registered"]}
        yield _CAMERAS.fill(cameras, faulty | lost)
    if stations := figures.get("stations"):
        yield _STATIONS.fill(stations, {name for name, each in stations.items() if not each["seen"]})
    clocks = {name: dict(camera["clock"]) for name, camera in cameras.items() if camera.get("clock") is not None}
    if any(clock["is_off"] for clock in clocks.values()):
        for clock in clocks.values():
            clock["set"] = " ".join(f"{seconds:.1f}" for seconds in clock["held_from_s"])
        yield _CLOCKS.fill({name: {"clock": clock} for name, clock in clocks.items()})
    body = ("root_position_sigma_mm", "root_rotation_sigma_deg", "jitter_mm")
    yield FigureTable("body", "measure", _SPREAD).fill({_words(name): figures[name] for name in body})
    if "equipment" in figures:
        yield from equipment_sections(figures["equipment"])
    if figures["sliding"].get("all", {"stances": 0})["stances"]:
        yield _SLIDING.fill(_sliding_rows(figures))
    if "gait" in figures:
        yield _gait_section(figures["gait"], figures.get("true_gait"))


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


def _agreement_sections(agreement: Mapping[str, Any]) -> Iterator[Section]:
    rows = {"joint position [cm]": agreement["position_cm"], "joint angle [deg]": agreement["angle_deg"]}
    rows |= {f"{name} [cm]": point["position_cm"] for name, point in agreement["points"].items()}
    table = FigureTable(f"against {agreement['with']} ({agreement['format']})", "error", _SPREAD)
    yield table.fill({name: spread for name, spread in rows.items() if spread is not None})
    planes = {
        f"{joint}, {plane}": figures
        for joint, each in agreement["joints"].items()
        for plane, figures in each["planes"].items()
    }
    if planes:
        yield _PLANES.fill(planes)


def equipment_sections(figures: Mapping[str, Any]) -> Iterator[Section]:
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


def _gait_section(gait: Mapping[str, Any], true: Mapping[str, Any] | None) -> Section:
    rows = {
        measure.name: gait[measure.key] | {"true": true[measure.key]["mean"] if true is not None else None}
        for measure in MEASURES
    }
    counts = ", ".join(f"{count} {side}" for side, count in gait["strides"].items())
    caption = (
        f"strides: {counts}; a stride goes from where the heel is furthest ahead of the pelvis to where it is so again "
        f"(Zeni 2008); symmetry: left less right over their mean; walking is {CRITERION}"
    )
    return FigureTable("walking", "measure", _GAIT, caption).fill(rows)
