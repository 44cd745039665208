"""What the solver counts of a recording for whoever judges its result."""

from collections import Counter
from dataclasses import dataclass, field


@dataclass
class SolverCounts:
    """Counts of frames.

    Attributes:
        rejected: camera -> frames in which its registration was rejected.
        interpolated: frames without any image that were filled in.
        contradictory: frames at the start that are not solved, for their cameras contradict each other.
        unconverged: states whose fit did not converge; their covariance is widened.
        restarted: how often gtsam could not solve the window, which was restarted from the latest prediction.
    """

    rejected: Counter[str] = field(default_factory=Counter)
    interpolated: int = 0
    contradictory: int = 0
    unconverged: int = 0
    restarted: int = 0

    def __add__(self, other: "SolverCounts") -> "SolverCounts":
        """The counts of both."""
        return SolverCounts(
            self.rejected + other.rejected,
            self.interpolated + other.interpolated,
            self.contradictory + other.contradictory,
            self.unconverged + other.unconverged,
            self.restarted + other.restarted,
        )

    def since(self, before: "SolverCounts") -> "SolverCounts":
        """What came to them after ``before``."""
        return SolverCounts(
            self.rejected - before.rejected,
            self.interpolated - before.interpolated,
            self.contradictory - before.contradictory,
            self.unconverged - before.unconverged,
            self.restarted - before.restarted,
        )

    def remarks(self) -> list[str]:
        """What a person should know of them, a sentence each."""
        remarks = []
        if self.contradictory:
            remarks.append(
                f"{self.contradictory} frames at the start are not solved: their cameras contradict each other; "
                "the list of rejected cameras shows which ones are wrong"
            )
        if self.unconverged:
            remarks.append(
                f"{self.unconverged} states did not converge; their covariances are widened, and they may be wrong by "
                "centimetres"
            )
        if self.restarted:
            remarks.append(
                f"the solver's window was restarted {self.restarted} times; states beside these times are less accurate"
            )
        return remarks
