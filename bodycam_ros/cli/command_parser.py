"""The parser of a command: short help, and settings as flags ``--group.name VALUE``."""

import argparse
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable
from typing import Any, NoReturn

from bodycam_ros.errors import BodycamError
from bodycam_ros.files.shown import other_than
from bodycam_ros.settings import check_name


class CommandParser(argparse.ArgumentParser):
    """Its usage line has what must be given.

    Attributes:
        read_groups: returns the names of the groups whose settings may be given as flags; called if one is given, for
            their import takes a second. The parsed arguments have them as ``settings``: group -> name -> text.
    """

    def __init__(self, *args: Any, **options: Any) -> None:
        super().__init__(*args, **options)
        self.read_groups: Callable[[], set[str]] | None = None
        self.add_argument(
            "-v", "--verbose", action="store_true", default=argparse.SUPPRESS, help="print more about what happens"
        )

    def parse_known_args(self, args: Iterable[str] | None = None, namespace: Any = None) -> tuple[Any, list[str]]:
        """As argparse does.

        Raises:
            BodycamError: an argument is given without another one that it needs.
        """
        words = list(sys.argv[1:] if args is None else args)
        settings: dict[str, dict[str, str]] = {}
        self.usage = self.usage or " ".join(("%(prog)s", *self._required()))
        if self.read_groups is not None:
            words, settings = self._split_settings(words, self.read_groups)
        arguments, rest = super().parse_known_args(words, namespace)
        if self.read_groups is not None:
            arguments.settings = settings
        for action in self._actions:
            needed = getattr(action, "needs", None)
            if needed and is_given(arguments, action.dest) and not is_given(arguments, needed):
                raise BodycamError(f"{action.option_strings[0]} needs --{needed.replace('_', '-')}")
        return arguments, rest

    def error(self, message: str) -> NoReturn:
        """Print what must be given and what is wrong, and exit with 2."""
        self.print_usage(sys.stderr)
        self.exit(2, f"{self.prog}: error: {message}\n'{self.prog} --help' explains it\n")

    def _split_settings(
        self, words: list[str], read_groups: Callable[[], set[str]]
    ) -> tuple[list[str], dict[str, dict[str, str]]]:
        """The other words, and group -> name -> text of settings."""
        others: list[str] = []
        settings: dict[str, dict[str, str]] = defaultdict(dict)
        following = iter(words)
        for word in following:
            flag, is_joined, text = word.partition("=")
            if not flag.startswith("--") or "." not in flag:
                others.append(word)
                continue
            group, _, name = flag.removeprefix("--").partition(".")
            check_name(group, flag)
            if group not in (known := read_groups()):
                self.error(f"{flag}: there is no group of settings {group} here; {other_than(group, sorted(known))}")
            value = text if is_joined else next(following, None)
            if value is None:
                self.error(f"{flag}: its value is missing")
            settings[group][name] = value
        return others, settings

    def _required(self) -> list[str]:
        """Flags and arguments that must be given, as they are written."""
        formatter = self._get_formatter()
        words = {action: formatter._format_args(action, action.dest.upper()) for action in self._actions}
        positional = [words[action] for action in self._actions if not action.option_strings]
        flags = [action for action in self._actions if action.option_strings and action.required]
        return [*positional, *(f"{action.option_strings[0]} {words[action]}" for action in flags), "[options]"]


def is_given(arguments: argparse.Namespace, name: str) -> bool:
    """Whether an argument has a value."""
    return getattr(arguments, name, None) not in (None, [], False)


STEPS = """\
bodycam: motion capture from body-mounted cameras. The steps:

  1. Photograph the place, an AprilTag board on its floor, and make a map of it:
       bodycam map REFERENCE_DIR -o MAP
  2. Strap the cameras on and note in RIG.yaml the segment of each camera. Record a
     range of motion, then the motion that you want. Make a bag from the videos of
     ordinary cameras; cameras that write ros2 bags do not need this step:
       bodycam ingest FILES_OR_FOLDER -o BAG
  3. Check the recording before you take the cameras off; this takes seconds. Leave
     out --rig if the recording is not a range of motion:
       bodycam doctor ROM_BAG --map MAP --rig RIG.yaml
  4. Make the body, skeleton and camera mounts, of the range of motion:
       bodycam body ROM_BAG --map MAP --rig RIG.yaml -o BODY.yaml
  5. Solve what you recorded:
       bodycam replay BAG --map MAP --body BODY.yaml -o OUT
  6. How good is it?  summary.png in DIR is the picture to look at first:
       bodycam evaluate OUT --recording BAG -o DIR
  7. Look at it in a browser, film it, take it to other programs:
       bodycam view OUT --map MAP --body BODY.yaml --recording BAG
       bodycam film OUT --map MAP -o FILE.mp4
       bodycam export OUT --to FORMAT -o FILE

'bodycam run DIR' takes steps 1, 2 and 4 to 6 in one go, for a folder laid out as
its --help says; 'bodycam study STUDY.yaml' for many recordings of many people.
'bodycam --help' lists all commands, 'bodycam COMMAND --help' explains one.
"""
