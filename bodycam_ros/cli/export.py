"""bodycam export: a body in the format of another program."""

import argparse
from collections.abc import Callable
from pathlib import Path

from bodycam_ros.body.body_file import read_body
from bodycam_ros.body.urdf import urdf_text


def add_parser(subparsers: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
    """Add the command."""
    parser = subparsers.add_parser("export", help="write a body in the format of another program", description=__doc__)
    parser.add_argument("source", type=Path, metavar="OUT", help="body YAML")
    parser.add_argument("--to", choices=sorted(FORMATS), required=True, help="format to write")
    parser.add_argument("-o", "--output", type=Path, required=True, metavar="FILE", help="file to write")
    parser.set_defaults(run=run)


def run(arguments: argparse.Namespace) -> int:
    """Run the command."""
    FORMATS[arguments.to](arguments.source, arguments.output)
    return 0


def _write_urdf(source: Path, output: Path) -> None:
    output.write_text(urdf_text(read_body(source)))


FORMATS: dict[str, Callable[[Path, Path], None]] = {"urdf": _write_urdf}
"""Format -> what writes it: source, file."""
