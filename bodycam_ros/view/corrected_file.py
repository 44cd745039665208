"""Writes a corrected body back to the file that it was read from."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from bodycam_ros.body.body_file import read_body, write_body
from bodycam_ros.body.body_model import BodyModel
from bodycam_ros.errors import BodyError
from bodycam_ros.view.correction import Correction, Move, Part
from bodycam_ros.whole_file import write_whole

CORRECTIONS = "corrections"
"""Key of the body's report: what was moved by hand, the oldest first."""


class BodyFile:
    """The file of a body that is being corrected.

    Attributes:
        path: of the file.
        original_path: where the first write keeps the file as it was.
    """

    def __init__(self, path: Path) -> None:
        self.path = path
        self.original_path = path.with_name(f"{path.name}.orig")
        self._read = b""

    def read(self) -> BodyModel:
        """The body.

        Raises:
            BodyError: the file is missing, not YAML, or describes no body.
        """
        body = read_body(self.path)
        self._read = self._content()
        return body

    def write(self, correction: Correction) -> BodyModel:
        """Write the corrected body, whole or not at all; return it with its report, which notes what was moved.

        The first write keeps the file as it was beside it; a file kept before is never replaced.

        Raises:
            BodyError: somebody else changed the file since.
            OutputError: it cannot be written.
        """
        if self._content() != self._read:
            raise BodyError(
                f"{self.path}: changed since it was read, so it is not replaced; keep your corrections by copying the "
                "file elsewhere first, or start 'bodycam view' again on the new one"
            )
        body = _noted(correction.body, correction.moves())
        kept_before = self.original_path.exists()
        if not kept_before:
            write_whole(self.original_path, self._read)
        try:
            write_body(body, self.path)
        except BaseException:
            if not kept_before:
                self.original_path.unlink(missing_ok=True)
            raise
        self._read = self._content()
        return body

    def _content(self) -> bytes:
        try:
            return self.path.read_bytes()
        except OSError as error:
            raise BodyError(f"{self.path}: cannot read this body file: {error}") from error


def _noted(body: BodyModel, moves: Iterable[tuple[Part, Move]]) -> BodyModel:
    before = body.report.get(CORRECTIONS, [])
    before = before if isinstance(before, list) else [before]
    return replace(body, report={**body.report, CORRECTIONS: [*before, *(_note(*moved) for moved in moves)]})


def _note(part: Part, move: Move) -> dict[str, Any]:
    noted = move.rounded()
    return {part.kind: part.name, "moved_mm": noted.shift_mm.tolist(), "turned_deg": noted.turn_deg.tolist()}
