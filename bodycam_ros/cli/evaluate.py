"""bodycam evaluate: how good is a solved recording, on its own or against the truth; exit code 3 if it is wrong."""

import argparse
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from rich.table import Table

from bodycam_ros.cli.equipment_tables import equipment_tables
from bodycam_ros.cli.outside_pictures import add_outside_flags, outside_files, outside_pictures
from bodycam_ros.cli.shown_progress import shown_progress, waiting
from bodycam_ros.cli.verdict_lines import camera_styles, exit_code, print_verdict
from bodycam_ros.terminal import Terminal, widened

if TYPE_CHECKING:
    from bodycam_ros.evaluate.evaluation import Evaluation


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("evaluate", description=__doc__)
    parser.add_argument("solved", type=Path, metavar="OUT", help="bag that 'bodycam replay' wrote")
    parser.add_argument(
        "--truth", type=Path, metavar="DIR", help="folder of a recording with ground truth, or its folder truth"
    )
    parser.add_argument(
        "--recording",
        type=Path,
        metavar="BAG",
        help="bag that OUT was solved from: adds reprojection errors and overlay.png",
    )
    add_outside_flags(parser)
    parser.add_argument(
        "-o", "--output", type=Path, required=True, metavar="DIR", help="folder for summary.json and summary.png"
    )
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    # matplotlib takes half a second to load; the other commands and --help do without.
    from bodycam_ros.evaluate.evaluation import evaluate
    from bodycam_ros.evaluate.overlay_picture import overlay_views
    from bodycam_ros.evaluate.report_folder import check_report_folder, write_report
    from bodycam_ros.output_place import check_output

    outside = outside_files(arguments)
    check_report_folder(arguments.output)
    inputs = (arguments.solved, arguments.truth, arguments.recording)
    check_output(arguments.output, (*inputs, arguments.stations, arguments.surface, arguments.map))
    _check_earlier(arguments.output)
    with waiting("reading and measuring"):
        evaluation = evaluate(arguments.solved, arguments.truth, arguments.recording)
    with waiting("looking at images"):
        overlay = overlay_views(evaluation.solved, arguments.recording) if arguments.recording is not None else ()
    if outside is None:
        with waiting("drawing"):
            write_report(evaluation, arguments.output, overlay)
    else:
        with shown_progress() as progress:
            more = outside_pictures(evaluation, arguments.recording, outside, arguments.video, progress)
            write_report(evaluation, arguments.output, overlay, more)
    _report(evaluation, arguments.output)
    print_verdict(Terminal(), evaluation.verdict)
    return exit_code(evaluation.verdict)


def _check_earlier(folder: Path) -> None:
    """Refuse to replace pictures of these names that no evaluation made: it writes figures along with each.

    Raises:
        OutputError: there are such.
    """
    from bodycam_ros.evaluate.report_folder import FEET, FIGURES, OUTSIDE, OVERLAY, PICTURE, VIDEO
    from bodycam_ros.output_place import check_file

    check_file(folder / FIGURES, force=True, mark=b'"image_coverage"', what="summary of 'bodycam evaluate'")
    if not (folder / FIGURES).exists():
        for name in (PICTURE, OVERLAY, OUTSIDE, FEET, VIDEO):
            check_file(folder / name, force=False, mark=b"", what="picture")


def _report(evaluation: "Evaluation", folder: Path) -> None:
    from bodycam_ros.evaluate.summary import summary

    figures = summary(evaluation)
    console = widened(Terminal())  # units stand in square brackets
    if figures["cameras"]:
        console.print(_camera_table(figures["cameras"], camera_styles(evaluation.verdict)))
    if "stations" in figures:
        console.print(_station_table(figures["stations"]))
    if any("clock" in camera for camera in figures["cameras"].values()):
        console.print(_clock_table(figures["cameras"]))
    console.print(_body_table(figures))
    if "equipment" in figures:
        for table in equipment_tables(figures["equipment"]):
            console.print(table)
    if figures["sliding"].get("all", {"stances": 0})["stances"]:
        console.print(_sliding_table(figures))
    if "truth" in figures:
        console.print(_joint_table(figures["truth"]))
        console.print(_truth_table(figures["truth"]))
    for line in (*_remarks(figures), f"written to {folder}"):
        console.print(line, soft_wrap=True)


def _camera_table(cameras: Mapping[str, Any], styles: Mapping[str, str]) -> Table:
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


def _station_table(stations: Mapping[str, Any]) -> Table:
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


def _clock_table(cameras: Mapping[str, Any]) -> Table:
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


def _body_table(figures: Mapping[str, Any]) -> Table:
    table = _spread_table("body")
    for name, key in (
        ("root position sigma [mm]", "root_position_sigma_mm"),
        ("root rotation sigma [deg]", "root_rotation_sigma_deg"),
        ("jitter of segments [mm]", "jitter_mm"),
    ):
        _add_spread(table, name, figures[key])
    return table


def _sliding_table(figures: Mapping[str, Any]) -> Table:
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


def _joint_table(truth: Mapping[str, Any]) -> Table:
    table = Table(title="joints against the truth, mean")
    table.add_column("segment")
    for column in ("position [cm]", "angle [deg]", "rotation [deg]"):
        table.add_column(column, justify="right")
    for name, joint in truth["per_joint"].items():
        table.add_row(name, *(_number(joint.get(key), 3) for key in ("position_cm", "angle_deg", "rotation_deg")))
    return table


def _truth_table(truth: Mapping[str, Any]) -> Table:
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


def _by_motion(classes: Sequence[Mapping[str, Any]]) -> str:
    """The registered share of each class of image motion; an end that is unknown has no end."""
    spans = [f"{c['low_px']:g}" + ("+" if c["high_px"] is None else f" to {c['high_px']:g}") for c in classes]
    return ", ".join(f"{span}: {c['registered']:.1%}" for span, c in zip(spans, classes, strict=True))


def _sliding_remarks(figures: Mapping[str, Any]) -> list[str]:
    sliding = figures["sliding"].get("all", {"stances": 0})
    if not sliding["stances"]:
        return []
    beyond = figures.get("sliding_against_truth", {}).get("all", {"beyond": {"stances": 0}})["beyond"]
    against = f"; {beyond['mean_mm']:.2f} mm beyond the true ones" if beyond["stances"] else ""
    return [
        f"standing feet slide by {sliding['mean_mm']:.2f} mm on average, {sliding['max_mm']:.1f} mm at most, in "
        f"{sliding['stances']} stances of heel or ball{against}"
    ]


def _remarks(figures: Mapping[str, Any]) -> list[str]:
    remarks = [
        f"{figures['instants']} instants in {figures['duration_s']:.2f} s, {figures['image_coverage']:.1%} of the "
        f"images covered; {figures['instants_without_camera']} instants without any camera"
    ]
    if figures["blur"]:
        remarks.append(f"registered at a motion of {_by_motion(figures['blur'])} px per image")
    remarks += [f"not solved: {start:.2f} to {end:.2f} s" for start, end in figures["gaps_s"]]
    remarks += _sliding_remarks(figures)
    if "truth" in figures:
        truth = figures["truth"]
        remarks.append(
            f"truth: coverage {truth['coverage']:.1%}, scale {truth['scale']:.5f}, tilt {truth['tilt_deg']:.3f} deg"
        )
        if truth["links_missing"]:
            remarks.append(f"in the truth, but not in the body: {', '.join(truth['links_missing'])}")
    return remarks
