"""Work that takes longer than a message may wait: it is begun, looked at now and then, and cancelled."""

from typing import Protocol


class Work(Protocol):
    """What is under way, or done.

    Attributes:
        step, share: what it is doing and how much of that is done, 0 to 1.
    """

    step: str
    share: float

    @property
    def result(self) -> tuple[bool, str] | None:
        """Whether it succeeded, and a summary or the error; None while it is under way."""

    def cancel(self) -> bool:
        """End it without a trace; False where it is too late for that."""
