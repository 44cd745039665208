"""Arrays with a row for each measurement."""

from dataclasses import dataclass, fields
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True, eq=False)
class Stacked:
    """Measurements of one kind, a row for each in every array."""

    def __add__(self, other: Self) -> Self:
        """The rows of both."""
        names = [each.name for each in fields(self)]
        return type(self)(*(np.concatenate([getattr(self, name), getattr(other, name)]) for name in names))

    def __getitem__(self, rows: NDArray[Any]) -> Self:
        """Some of the rows, by number or mask."""
        return type(self)(*(getattr(self, each.name)[rows] for each in fields(self)))
