"""The columns of the table over all recordings: one list for terminal, page and CSV."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

from bodycam_ros.evaluate.page.page import number
from bodycam_ros.study.recording_result import RecordingResult


@dataclass(frozen=True)
class StudyColumn:
    """A column of numbers.

    Attributes:
        heading: for people, with the unit.
        key: in the CSV, with the unit.
        of: its value; None if it is not known.
        decimals: that people are shown.
        factor: of what people are shown.
    """

    heading: str
    key: str
    of: Callable[[RecordingResult], float | None]
    decimals: int
    factor: float = 1.0

    def cell(self, result: RecordingResult) -> str:
        """As people are shown it; empty if it is not known."""
        value = self.of(result)
        return number(None if value is None else self.factor * value, self.decimals)


def _figure(*ways: tuple[str, ...]) -> Callable[[RecordingResult], float | None]:
    """The first of some numbers that an evaluation has."""

    def of(result: RecordingResult) -> float | None:
        return next((value for keys in ways if (value := result.figure(*keys)) is not None), None)

    return of


def _registered(result: RecordingResult) -> float | None:
    return result.registered if result.failed is None else None


COLUMNS: Sequence[StudyColumn] = (
    StudyColumn("duration [s]", "duration_s", _figure(("duration_s",)), 1),
    StudyColumn("registered [%]", "registered", _registered, 1, 100.0),
    StudyColumn(
        "joints off [cm]",
        "position_error_cm",
        _figure(("truth", "position_cm", "mean"), ("agreement", "position_cm", "mean")),
        2,
    ),
    StudyColumn(
        "angles off [deg]",
        "angle_error_deg",
        _figure(("truth", "angle_deg", "mean"), ("agreement", "angle_deg", "mean")),
        2,
    ),
    StudyColumn("feet slide [mm]", "sliding_mm", _figure(("sliding", "all", "mean_mm")), 1),
    StudyColumn("speed [m/s]", "speed_m_s", _figure(("gait", "speed_m_s", "mean")), 2),
    StudyColumn("cadence [1/min]", "cadence_per_min", _figure(("gait", "cadence_per_min", "mean")), 1),
    StudyColumn("took [s]", "took_s", lambda result: result.seconds, 0),
)


def shown_columns(results: Sequence[RecordingResult]) -> list[StudyColumn]:
    """Those of which something is known."""
    return [column for column in COLUMNS if any(column.of(result) is not None for result in results)]
