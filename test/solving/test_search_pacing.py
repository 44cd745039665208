"""A search in vain is not made again at once."""

from bodycam_ros.solving.search_pacing import SearchPacing

S = 1_000_000_000
FEET = frozenset({"left", "right"})


def searches(until_s: float, seen: frozenset[str] = FEET) -> list[float]:
    """When [s] searches are made that never help, at 30 instants a second."""
    pacing, made = SearchPacing(), []
    for instant in range(round(30 * until_s)):
        stamp_ns = instant * S // 30
        if pacing.is_due(stamp_ns, seen):
            made.append(stamp_ns / S)
            pacing.in_vain(stamp_ns)
    return made


def test_each_search_in_vain_doubles_the_wait_up_to_two_seconds() -> None:
    waits = [later - earlier for earlier, later in zip(searches(20.0), searches(20.0)[1:], strict=False)]
    assert waits[:4] == sorted(waits[:4]) and 0.2 <= waits[0] < 0.25
    assert all(2.0 <= wait < 2.05 for wait in waits[4:])


def test_what_is_seen_anew_is_looked_for_at_once() -> None:
    pacing = SearchPacing()
    assert pacing.is_due(S, FEET)
    pacing.in_vain(S)
    assert not pacing.is_due(S + 1, FEET)
    assert pacing.is_due(S + 1, FEET | {"hand"})
