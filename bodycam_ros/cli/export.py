"""bodycam export: what was solved, or a body, in the format of another program."""

import argparse
from pathlib import Path

from bodycam_ros.export.formats import FORMATS, export
from bodycam_ros.output_place import check_output
from bodycam_ros.shown import printable


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser(
        "export",
        description=__doc__,
        epilog="formats: " + "; ".join(f"{name}: {form.what}" for name, form in FORMATS.items()),
    )
    parser.add_argument(
        "source", type=Path, metavar="OUT", help="bag that 'bodycam replay' wrote, or a body file, YAML or URDF"
    )
    parser.add_argument("--to", choices=sorted(FORMATS), required=True, help="format to write")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="file to write")
    parser.add_argument("--force", action="store_true", help="replace FILE if it is there already")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    check_output(arguments.output, (arguments.source,), makes_folders=False)
    written = export(arguments.source, arguments.to, arguments.output, arguments.force)
    print(f"written to {' and '.join(printable(str(path)) for path in written)}")
    return 0
