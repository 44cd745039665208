"""Files in which a user says what static cameras need to know."""

from dataclasses import dataclass
from pathlib import Path


@dataclass(frozen=True)
class OutsideInput:
    """Where they are.

    Attributes:
        stations: where they stand, and their lenses.
        surface: folder of the segments' meshes; None for the body's own, or capsules.
        start: where the body is in the first image; None where worn cameras tell.
    """

    stations: Path
    surface: Path | None = None
    start: Path | None = None
