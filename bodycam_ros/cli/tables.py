"""Tables that 'bodycam evaluate' prints of a recording's figures."""

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Any

from rich.table import Table
from rich.text import Text

from bodycam_ros.terminal import Terminal
from bodycam_ros.verdict import Level, Verdict


def camera_table(cameras: Mapping[str, Any], styles: Mapping[str, str]) -> Table:
    """What worn cameras knew; of those the verdict names, in its style."""
    with_pixels = any("reprojection_px" in camera for camera in cameras.values())
    with_light = any("brightness" in camera for camera in cameras.values())
    caption = (
        "lost: the longest time without a pose; motion: of the picture from image to image, 95th percentile; "
        "gap: from the registered to the solved pose, median"
    )
    if with_pixels:
        caption += "; error: of landmarks in the solved pose, median"
    if with_light:
        caption += "; light: the brightest over the darkest"
    table = Table(title="cameras", caption=caption)
    table.add_column("camera", no_wrap=True)
    columns = ("images", "registered", "lost [s]", "tracks", "landmarks", "motion [px]", "gap [mm]", "gap [deg]")
    for column in (*columns, *(("error [px]",) if with_pixels else ()), *(("light",) if with_light else ())):
        table.add_column(column, justify="right")
    for name, camera in cameras.items():
        lost_s = camera["longest_lost_s"]
        row = [
            str(camera["images"]),
            f"{camera['registered']:.1%}",
            f"{lost_s:.2f}" if lost_s else "",
            _number(camera["tracks"], 0),
            _number(camera["landmarks"], 0),
            _number(camera["image_motion_px"]["p95"], 1),
            _number(camera["position_gap_mm"]["median"], 1),
            _number(camera["rotation_gap_deg"]["median"], 2),
        ]
        if with_pixels:
            row.append(_number(camera.get("reprojection_px", {}).get("median"), 2))
        if with_light:
            row.append(_number(camera.get("brightness", {}).get("range"), 2))
        table.add_row(name, *row, style=styles.get(name, None if camera["registered"] > 0.0 else "red"))
    return table


def station_table(stations: Mapping[str, Any]) -> Table:
    """What static cameras saw."""
    table = Table(
        title="static cameras",
        caption="seen: share of the images that tell where a segment is; confidence: share of the contour that does",
    )
    table.add_column("camera", no_wrap=True)
    for column in ("images", "seen", "segments", "confidence"):
        table.add_column(column, justify="right")
    for name, station in stations.items():
        seen, segments, confidence = (station[key] for key in ("seen", "segments", "confidence"))
        row = (str(station["images"]), f"{seen:.1%}", f"{segments:.1f}", f"{confidence:.1%}")
        table.add_row(name, *row, style=None if seen else "red")
    return table


def clock_table(cameras: Mapping[str, Any]) -> Table:
    """How far clocks were off."""
    table = Table(title="clocks", caption="ahead of the recording's time (+) or behind, as corrected; at last if set")
    table.add_column("camera", no_wrap=True)
    for column in ("clock [ms]", "+-", "drift [ppm]", "+-", "became another at [s]", "read-out [ms]", "+-"):
        table.add_column(column, justify="right")
    for name, camera in cameras.items():
        if (clock := camera.get("clock")) is None:
            continue
        table.add_row(
            name,
            _number(clock["ahead_ms"], 1),
            _number(clock["ahead_sigma_ms"], 1),
            _number(clock["drift_ppm"], 0),
            _number(clock["drift_sigma_ppm"], 0),
            " ".join(_number(seconds, 1) for seconds in clock["held_from_s"]),
            _number(clock["readout_ms"], 2),
            _number(clock["readout_sigma_ms"], 2),
            style="bold" if clock["is_off"] else None,
        )
    return table


def body_table(figures: Mapping[str, Any]) -> Table:
    """What the solver itself believes."""
    table = _spread_table("body")
    for name, key in (
        ("root position sigma [mm]", "root_position_sigma_mm"),
        ("root rotation sigma [deg]", "root_rotation_sigma_deg"),
        ("jitter of segments [mm]", "jitter_mm"),
    ):
        _add_spread(table, name, figures[key])
    return table


def sliding_table(figures: Mapping[str, Any]) -> Table:
    """Feet by stances of their own, and by those of the truth."""
    table = Table(
        title="sliding of standing feet",
        caption="horizontal distance of heel or ball from its mean place in a stance; way: how long it is in a stance",
    )
    table.add_column("foot", no_wrap=True)
    for column in ("stances", "standing [s]", "mean [mm]", "max [mm]", "way [mm]"):
        table.add_column(column, justify="right")
    rows = dict(figures["sliding"])
    for foot, of in figures.get("sliding_against_truth", {}).items():
        rows |= {
            f"{foot} while the true one stands": of["solved"],
            f"{foot}, the true one": of["true"],
            f"{foot} beyond the true one": of["beyond"],
        }
    for name, sliding in rows.items():
        lengths = (_number(sliding[key], 2) for key in ("mean_mm", "max_mm", "way_mm"))
        table.add_row(name, str(sliding["stances"]), _number(sliding["standing_s"], 2), *lengths)
    return table


def constraint_table(constraints: Mapping[str, Any]) -> Table:
    """What is held, with the equipment and without."""
    table = Table(title="with and without equipment", caption="distance from where the equipment holds a point")
    table.add_column("")
    for column in ("with: mean", "max", "without: mean", "max"):
        table.add_column(column, justify="right")
    for name, both in constraints["measures"].items():
        cells = (_number(both[which][of], 2) for which in ("with", "without") for of in ("mean", "max"))
        table.add_row(name, *cells)
    return table


def joint_table(truth: Mapping[str, Any]) -> Table:
    """Errors per joint."""
    table = Table(title="joints against the truth, mean")
    table.add_column("segment")
    for column in ("position [cm]", "angle [deg]", "rotation [deg]"):
        table.add_column(column, justify="right")
    for name, joint in truth["per_joint"].items():
        table.add_row(name, *(_number(joint.get(key), 3) for key in ("position_cm", "angle_deg", "rotation_deg")))
    return table


def truth_table(truth: Mapping[str, Any]) -> Table:
    """Errors overall."""
    table = _spread_table("against the truth")
    for name, key in (
        ("position [cm]", "position_cm"),
        ("position, scale fitted [cm]", "sim_position_cm"),
        ("angle [deg]", "angle_deg"),
        ("rotation [deg]", "rotation_deg"),
    ):
        _add_spread(table, name, truth[key])
    return table


def _spread_table(title: str) -> Table:
    table = Table(title=title)
    table.add_column("measure")
    for column in ("mean", "median", "p95", "max"):
        table.add_column(column, justify="right")
    return table


def _add_spread(table: Table, name: str, spread: Mapping[str, float | None]) -> None:
    table.add_row(name, *(_number(spread[column], 3) for column in ("mean", "median", "p95", "max")))


def _number(value: float | None, decimals: int) -> str:
    return "" if value is None else f"{value:.{decimals}f}"


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
        deviation = (_equipment_number(each["deviation_mm"][key]) for key in ("mean", "p95", "max"))
        apart = _equipment_number(each["apart_mm"]["median"])
        table.add_row(name, f"{each['held']:.1%}", *deviation, apart, _stretches(each["let_go_s"]))
    yield table
    if figures["lengths"]:
        table = Table(title="lengths of it that were unknown")
        table.add_column("length", no_wrap=True)
        for column in ("value [mm]", "+-"):
            table.add_column(column, justify="right")
        for name, length in figures["lengths"].items():
            table.add_row(name, _equipment_number(length["value_mm"]), _equipment_number(length["sigma_mm"]))
        yield table


def _stretches(stretches: Sequence[Sequence[float]]) -> str:
    told = [f"{start:.2f} to {end:.2f}" for start, end in stretches[:_MOST_STRETCHES]]
    more = len(stretches) - len(told)
    return ", ".join(told) + (f" and {more} more" if more else "")


def _equipment_number(value: float | None) -> str:
    # NaN alone differs from itself.
    return "" if value is None or value != value else f"{value:.1f}"


if TYPE_CHECKING:
    from bodycam_ros.evaluate.gait import Gait


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
    """Print the verdict and a line for each finding, coloured where the terminal can."""
    for finding in verdict.findings:
        line = Text.assemble((f"{finding.level.word}: ", _STYLES[finding.level]), finding.text)
        terminal.print(line, soft_wrap=True)
    terminal.print(Text(f"verdict: {verdict.text}", _STYLES[verdict.level]), soft_wrap=True)


def camera_styles(verdict: Verdict) -> dict[str, str]:
    """Camera that was found at fault -> the style of its row in a table."""
    # The worst comes first and stays.
    return {finding.camera: _STYLES[finding.level] for finding in reversed(verdict.findings)}


def exit_code(verdict: Verdict) -> int:
    """0, or that of a result that should not be used."""
    return WRONG_RESULT if verdict.level is Level.WRONG else 0
