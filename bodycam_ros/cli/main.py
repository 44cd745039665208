"""The command ``bodycam``: one file per subcommand, imported by name."""

import argparse
import logging
import signal
import sys
from collections.abc import Callable, Sequence
from importlib import import_module
from types import FrameType
from typing import NoReturn

from rich.console import Console
from rich.logging import RichHandler

from bodycam_ros import __version__
from bodycam_ros.errors import BodycamError

COMMANDS = ("map", "body", "replay", "evaluate", "export", "bench", "settings", "view")
"""Modules of ``bodycam_ros.cli``; each has ``add_parser(subparsers)``, which sets ``run``: arguments -> exit code."""

FAILED, INTERRUPTED, TERMINATED = 1, 128 + signal.SIGINT, 128 + signal.SIGTERM


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand and return its exit code: 0, 1 for an error of the user's, 2 for wrong usage, 130 for Ctrl-C."""
    arguments = _parser().parse_args(argv)
    _log_to_stderr(arguments.verbose)
    # A terminated run cleans up like an interrupted one: nothing half-written stays.
    signal.signal(signal.SIGTERM, _terminate)
    run: Callable[[argparse.Namespace], int] = arguments.run
    try:
        return run(arguments)
    except BodycamError as error:
        print(f"bodycam: error: {error}", file=sys.stderr)
        return FAILED
    except KeyboardInterrupt:
        print("bodycam: interrupted", file=sys.stderr)
        return INTERRUPTED


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="bodycam",
        description="Motion capture from body-mounted cameras: images in, a metric skeleton in the world out.",
    )
    parser.add_argument("--version", action="version", version=f"bodycam {__version__}")
    parser.add_argument("-v", "--verbose", action="store_true", help="say more about what happens")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    for command in COMMANDS:
        import_module(f"bodycam_ros.cli.{command}").add_parser(subparsers)
    return parser


def _log_to_stderr(verbose: bool) -> None:
    handler = RichHandler(console=Console(stderr=True), show_time=False, show_path=False, markup=False)
    logging.basicConfig(level=logging.DEBUG if verbose else logging.WARNING, format="%(message)s", handlers=[handler])


def _terminate(signal_number: int, frame: FrameType | None) -> NoReturn:
    raise SystemExit(TERMINATED)


if __name__ == "__main__":
    sys.exit(main())
