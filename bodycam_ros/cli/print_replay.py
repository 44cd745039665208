"""What ``bodycam replay`` prints in the end: tables of cameras and equipment, remarks, the verdict."""

from collections.abc import Sequence
from pathlib import Path

from bodycam_ros.cli.output import print_sections, print_verdict
from bodycam_ros.cli.terminal import Terminal
from bodycam_ros.evaluate.sections import column_table
from bodycam_ros.files.merged_lines import merge_lines
from bodycam_ros.lens.lens_check import find_mismatches
from bodycam_ros.recording.topic_names import TopicNames
from bodycam_ros.replaying.extend import ExtensionRound
from bodycam_ros.replaying.replay_remarks import clock_remarks
from bodycam_ros.replaying.replay_summary import ReplaySummary

_COLUMNS = (
    ("images", "images", "d"), ("registered", "registered", ".1%"), ("dropped", "dropped", "d"),
    ("missing", "missing", "d"), ("not wanted", "left_out", "d"), ("read-out [ms]", "readout", ""),
)  # fmt: skip
_NOTE = (
    "registered: share of images with a pose in the map; dropped: images that could not be used; missing: images that "
    "the recording counts but does not contain; not wanted: images beyond images.max_rate; read-out: time from the "
    "first row to the last, 0 for a global shutter"
)


def print_replay(summary: ReplaySummary, recording: Path, output: Path, names: TopicNames) -> int:
    """Print what came of a replay; the exit code."""
    terminal = Terminal()
    if summary.rounds:
        print_rounds(summary.rounds)
    rows = {
        camera: {
            "images": images,
            "registered": summary.registered[camera] / images,
            "dropped": summary.skipped[camera] or None,
            "missing": summary.lost[camera] or None,
            "left_out": summary.left_out[camera] or None,
            "readout": summary.readouts[camera].milliseconds if camera in summary.readouts else None,
        }
        for camera, images in sorted((summary.images + summary.lost).items())
    }
    faulty = {finding.subject for finding in summary.verdict.findings}
    print_sections(terminal, [column_table("cameras", "camera", _COLUMNS, rows, _NOTE, faulty)])
    if summary.equipment is not None:
        from bodycam_ros.evaluate.equipment import equipment_figures
        from bodycam_ros.evaluate.report_sections import equipment_sections

        print_sections(terminal, equipment_sections(equipment_figures(summary.equipment, summary.start_ns)))
    if any(finding.check == "body" for finding in summary.verdict.findings):
        # Whatever else is odd follows from the wrong body.
        return print_verdict(terminal, summary.verdict)
    mismatches = find_mismatches(recording, summary.doubted_cameras, names) if summary.doubted_cameras else ()
    for remark in merge_lines((*summary.remarks, *(match.text for match in mismatches))):
        terminal.print(remark, style="red")
    clocks = clock_remarks(summary.timings, summary.speeds, summary.clock_sigma_s)
    rejected = (
        f"camera {camera}: rejected in {count} frames, because it contradicts the other cameras"
        for camera, count in summary.rejected.most_common()
    )
    for line in merge_lines((*summary.notes, *clocks, *rejected)):
        terminal.print(line)
    share = summary.solved / summary.frames if summary.frames else 0.0
    took = f" in {summary.elapsed_s:.1f} s ({summary.real_time_factor:.2f} of real time)" if summary.elapsed_s else ""
    terminal.print(
        f"{summary.solved} of {summary.frames} frames solved ({share:.1%}), {summary.predicted} of them without "
        f"any camera ({summary.interpolated} without any image); {summary.recorded_s:.1f} s solved{took}; "
        f"written to {output}"
    )
    return print_verdict(terminal, summary.verdict)


def print_rounds(rounds: Sequence[ExtensionRound]) -> None:
    """Print the share of registered images per camera and round of map extension."""
    columns = [(f"round {count}", str(count), ".1%") for count in range(1, len(rounds) + 1)]
    rows = {
        camera: {str(n): one.shares[camera] for n, one in enumerate(rounds, 1)} for camera in sorted(rounds[0].shares)
    }
    rows["all"] = {str(n): one.share for n, one in enumerate(rounds, 1)}
    terminal = Terminal()
    print_sections(terminal, [column_table("registered images", "camera", columns, rows)])
    terminal.print(f"{rounds[0].absolute:.1%} of all images are registered by landmarks of the photographs")
