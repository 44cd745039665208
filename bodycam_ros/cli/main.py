"""The command ``bodycam``: one file per command, imported when it is used."""

import argparse
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module

from bodycam_ros import __version__
from bodycam_ros.cli.command_parser import STEPS, CommandParser
from bodycam_ros.cli.failure import failure_message
from bodycam_ros.cli.signals import EndingSignals
from bodycam_ros.cli.standard_streams import discard_output, secure_streams
from bodycam_ros.files.bounded_inputs import bound_inputs
from bodycam_ros.files.shown import printable, shortened
from bodycam_ros.study.study_lock import end_with_study

GROUPS = {
    "capture": {
        "board": "print a board for maps and lenses",
        "lens": "calibrate a camera's lens from a video or images of a board",
        "ingest": "make a bag from the videos of ordinary cameras",
        "doctor": "check a recording before the long run, and before going home",
    },
    "solve": {
        "map": "build a reference map from photographs or a video",
        "map extend": "add landmarks to a map from the body cameras of a recording",
        "stations": "find where static cameras are in a map",
        "body": "estimate skeleton and camera mounts from a range of motion",
        "replay": "solve a recorded bag offline",
        "replay first": "find what all stretches of a long recording share: clocks, read-out times, where they begin",
        "replay stretch": "solve one stretch of a long recording",
        "replay merge": "make one bag of all stretches of a recording",
        "run": "all steps for a folder of recordings",
        "study": "all steps for many recordings, on all cores",
    },
    "inspect": {
        "body check": "count degrees of freedom with the equipment attached; list conflicting constraints",
        "evaluate": "measure and draw how good a solved recording is",
        "view": "show a body in a browser, and correct it",
        "settings": "print all settings with their defaults",
    },
    "hand over": {
        "film": "film the solved person in the place, or over recorded images",
        "export": "write a solved recording or a body for other programs",
    },
}
"""Group -> command -> purpose.

Each command is a module of ``bodycam_ros.cli``, whose docstring and ``EPILOG`` are its help, with
``add_arguments(parser)`` and ``run``: arguments -> exit code. What takes a second to load (matplotlib, viser, scipy's
optimisation) is imported in ``run``: help is there at once.
A command of two words ("map extend") is ``map_extend``; a folder that is really named "extend" is ``./extend``.
"""

COMMANDS = {command: purpose for group in GROUPS.values() for command, purpose in group.items()}

FAILED = 1
_SIGNALLED = 128


def main(argv: Sequence[str] | None = None) -> int:
    """Run a command and return its exit code.

    0, 1 for an error of the user's, 2 for wrong usage, 3 for a result that should not be used, 128 + the number of the
    signal that ended it (130 for Ctrl-C).
    """
    if argv is None:
        secure_streams()
        end_with_study()
    with EndingSignals() as signals:
        code = _run(sys.argv[1:] if argv is None else argv, signals)
        if argv is None and code >= _SIGNALLED:
            discard_output()
        return code


def _run(argv: Sequence[str], signals: EndingSignals) -> int:
    try:
        bound_inputs()
        words = join_command(argv)
        if not words:
            print(STEPS, end="")
            return 0
        arguments = make_parser(words).parse_args(words)
        import_module("bodycam_ros.cli.terminal").log_to_terminal(arguments.verbose)
        run: Callable[[argparse.Namespace], int] = arguments.run
        code = run(arguments)
        sys.stdout.flush()
        return code
    except BaseException as error:
        if signals.received is not None:  # the exception may have been replaced meanwhile
            if signals.received == signal.SIGINT:
                with suppress(OSError, ValueError):
                    print("bodycam: interrupted", file=sys.stderr, flush=True)
            return signals.exit_code
        if (message := failure_message(error)) is None:
            raise
        print(f"bodycam: error: {printable(shortened(message))}", file=sys.stderr)
        return FAILED


def join_command(argv: Sequence[str]) -> list[str]:
    """The words of a command line, with a command of two words as one word."""
    words = list(argv)
    first = next((index for index, word in enumerate(words) if not word.startswith("-")), len(words))
    if (command := " ".join(words[first : first + 2])) in COMMANDS:
        words[first : first + 2] = [command]
    return words


def make_parser(words: Sequence[str] = ()) -> CommandParser:
    """A parser with the flags of the command in ``words``, and the names of all others."""
    width = max(map(len, COMMANDS))
    groups = [
        "\n".join([f"{group}:", *(f"    {command:{width}}  {purpose}" for command, purpose in commands.items())])
        for group, commands in GROUPS.items()
    ]
    parser = CommandParser(
        prog="bodycam",
        usage="%(prog)s COMMAND [options]",
        description="Motion capture from body-mounted cameras: images in, a metric skeleton in the world out.",
        epilog="\n\n".join(groups)
        + "\n\n'bodycam' alone shows the steps in their order, 'bodycam COMMAND --help' explains a command",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    parser.add_argument("--version", action="version", version=f"bodycam {__version__}")
    parser.set_defaults(verbose=False)
    subparsers = parser.add_subparsers(prog="bodycam", metavar="COMMAND", required=True, help=argparse.SUPPRESS)
    asked = next((word for word in words if not word.startswith("-")), None)
    for command in COMMANDS:
        own = subparsers.add_parser(command)
        if command == asked:
            module = import_module(f"bodycam_ros.cli.{command.replace(' ', '_')}")
            own.description, own.epilog = module.__doc__, getattr(module, "EPILOG", None)
            own.set_defaults(run=module.run)
            module.add_arguments(own)
    return parser


if __name__ == "__main__":
    sys.exit(main())
