"""When to look for the equipment all around again: a search that did not help is not made at every instant."""

from collections.abc import Hashable

_FIRST_NS, _LONGEST_NS = 200_000_000, 2_000_000_000


class SearchPacing:
    """Waits after a search in vain, twice as long each time; what is seen anew is a reason to look at once."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """The next search is due at once."""
        self._due_ns, self._wait_ns = -(1 << 62), _FIRST_NS
        self._seen: Hashable = None

    def is_due(self, stamp_ns: int, seen: Hashable) -> bool:
        """Whether to search at an instant [ns] at which something is seen."""
        if seen != self._seen:
            self.forget()
            self._seen = seen
        return stamp_ns >= self._due_ns

    def in_vain(self, stamp_ns: int) -> None:
        """The search at an instant [ns] did not help."""
        self._due_ns = stamp_ns + self._wait_ns
        self._wait_ns = min(2 * self._wait_ns, _LONGEST_NS)
