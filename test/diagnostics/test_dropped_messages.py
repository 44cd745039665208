"""Lost and dropped messages are counted; the first of a kind is logged."""

from bodycam_ros.diagnostics.dropped_messages import DroppedMessages, LostMessages


def test_the_chain_of_stamps_shows_what_is_missing() -> None:
    lost = LostMessages()
    assert not lost.add("head", 20, 10), "whatever came before the first message is not missed"
    assert not lost.add("head", 30, 20)
    assert not lost.add("foot", 30, 20), "each camera has a chain of its own"
    assert lost.add("head", 50, 40)
    assert not lost.add("head", 60, 50)
    assert not lost.add("head", 70, 0), "a tracker that started again has no predecessor"


def test_the_first_of_a_kind_is_logged_and_all_are_counted() -> None:
    logged: list[str] = []
    dropped = DroppedMessages(logged.append)
    for reason in ("a grey one", "a green one"):
        dropped.add("images", reason)
    dropped.add("messages", "a short one")
    assert dropped.counts == {"images": 2, "messages": 1}
    assert [("a grey one" in line, "a short one" in line) for line in logged] == [(True, False), (False, True)]
    assert (dropped.count_new(), dropped.count_new()) == (3, 0)
    assert dropped.latest == "a short one"
