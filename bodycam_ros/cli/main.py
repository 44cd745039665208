"""The command ``bodycam``: one file per subcommand, imported by name."""

import argparse
import errno
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from io import TextIOWrapper

from bodycam_ros import __version__
from bodycam_ros.cli.command_parser import THE_WAY, CommandParser
from bodycam_ros.cli.ending import Ending, let_go_of_the_terminal
from bodycam_ros.errors import BodycamError
from bodycam_ros.own_process import bound_inputs
from bodycam_ros.shown import printable

COMMANDS = {
    "run": "all steps for a folder of recordings, in one go",
    "study": "all steps for many recordings, on all cores or a cluster",
    "board": "print a board for maps and lenses",
    "lens": "measure a camera's lens by a video or images of a board",
    "map": "build a reference map from photographs or a video",
    "map check": "say and draw what a reference map covers",
    "map extend": "let a map grow by a recording",
    "ingest": "make a bag of videos from ordinary cameras",
    "stations": "find where static cameras stand",
    "doctor": "is a recording good enough? before the long run, and before going home",
    "body": "estimate skeleton and camera mounts from a range of motion",
    "body check": "count what a body can do with its equipment, name what contradicts",
    "replay": "solve a recorded bag offline",
    "evaluate": "measure and picture a solved recording",
    "view": "look at a body in a browser, and correct it",
    "export": "write a solved recording or a body for other programs",
    "settings": "print all settings with their defaults",
    "latency": "time the live graph from image to joint state (needs ROS 2)",
}
"""Command -> what it is for, in the order of the way through.

Each is a module of ``bodycam_ros.cli`` with ``add_parser(subparsers)``, which sets ``run``: arguments -> exit code. Its
import and ``add_parser`` load nothing heavy, so that help is there at once.
A command may have two words ("map check" is ``map_check``). They come one after the other, and go before what the first
of them alone would make of the second: a folder that is really named "check" is ``./check``.
"""

FAILED = 1
_ENDED = 128
_NO_READER = _ENDED + 13  # as a shell says of who wrote to a pipe that nobody reads (SIGPIPE)


def main(argv: Sequence[str] | None = None) -> int:
    """Run a subcommand and return its exit code.

    0, 1 for an error of the user's, 2 for wrong usage, 3 for a result that should not be used, 128 + the number of the
    signal that ended it (130 for Ctrl-C).
    """
    ending = Ending()
    ending.answer()
    if argv is None:
        code = _run(argv, ending)
        if code >= _ENDED:  # a signal, or a pipe without a reader: the streams may lead nowhere
            let_go_of_the_terminal()
        return code
    # Somebody else's process, which goes on.
    try:
        return _run(argv, ending)
    finally:
        ending.forget()


def _run(argv: Sequence[str] | None, ending: Ending) -> int:
    bound_inputs()
    # A name that is not UTF-8 must not keep a message from being printed.
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, TextIOWrapper):
            with suppress(OSError):  # put in the place of one that could seek
                stream.reconfigure(errors="backslashreplace")
    words = _command_joined(sys.argv[1:] if argv is None else argv)
    if not words:
        print(THE_WAY, end="")
        return 0
    arguments = _parser(words).parse_args(words)
    import_module("bodycam_ros.terminal").log_to_terminal(arguments.verbose)
    run: Callable[[argparse.Namespace], int] = arguments.run
    try:
        ending.begin()
        code = run(arguments)
        sys.stdout.flush()
        return code
    except BaseException as error:
        if ending.cause is not None:  # what came of the signal, be it what it may
            ending.say()
            return ending.exit_code
        if isinstance(error, BrokenPipeError):
            return _NO_READER
        if (message := _message(error)) is None:
            raise
        print(f"bodycam: error: {printable(message)}", file=sys.stderr)
        return FAILED
    finally:
        ending.end()


def _message(error: BaseException) -> str | None:
    """What to tell the user; None if it is a defect of ours, whose traceback we want to see."""
    if isinstance(error, BodycamError):
        return str(error)
    if isinstance(error, MemoryError) or (isinstance(error, OSError) and error.errno == errno.ENOMEM):
        return "there is not enough memory for this"
    if isinstance(error, OSError) and error.filename is not None:
        return f"{error.filename}: {error.strerror}"
    if isinstance(error, OSError) and error.errno is not None:
        return str(error.strerror)
    return None


def _command_joined(argv: Sequence[str]) -> list[str]:
    """The words of a command line, a command of two of them as the one that argparse knows."""
    words = list(argv)
    first = next((at for at, word in enumerate(words) if not word.startswith("-")), len(words))
    if (command := " ".join(words[first : first + 2])) in COMMANDS:
        words[first : first + 2] = [command]
    return words


def _parser(argv: Sequence[str] = ()) -> CommandParser:
    """Knows the flags of the command that is asked for; of the others what they are for."""
    parser = CommandParser(
        prog="bodycam",
        description="Motion capture from body-mounted cameras: images in, a metric skeleton in the world out.",
        epilog="'bodycam' alone shows the steps in their order, 'bodycam COMMAND --help' explains a command",
    )
    parser.add_argument("--version", action="version", version=f"bodycam {__version__}")
    parser.add_argument("-v", "--verbose", action="store_true", help="say more about what happens")
    subparsers = parser.add_subparsers(title="commands", metavar="COMMAND", required=True)
    asked = next((word for word in argv if not word.startswith("-")), None)
    for command, purpose in COMMANDS.items():
        if command == asked:
            import_module(f"bodycam_ros.cli.{command.replace(' ', '_')}").add_parser(subparsers)
        else:
            subparsers.add_parser(command, help=purpose)
    return parser


if __name__ == "__main__":
    sys.exit(main())
