"""Who is blamed: the fewest cameras that explain what does not fit."""

from bodycam_ros.verdict.contradiction import blame

ALIKE = {"a": 1.0, "b": 1.0, "c": 1.0, "d": 1.0}
LIMIT = 0.1


def test_nobody_is_blamed_for_small_gaps() -> None:
    assert blame({("a", "b"): 0.05, ("b", "c"): 0.09}, LIMIT, ALIKE.__getitem__) == ([], {})


def test_who_contradicts_all_is_blamed_alone() -> None:
    gaps = {("a", "b"): 0.9, ("b", "c"): 0.8, ("c", "d"): 0.01, ("a", "d"): 0.02}
    assert blame(gaps, LIMIT, ALIKE.__getitem__) == (["b"], {})


def test_at_the_end_of_a_chain_who_agrees_with_others_is_believed() -> None:
    assert blame({("a", "b"): 0.01, ("b", "c"): 0.01, ("c", "d"): 0.9}, LIMIT, ALIKE.__getitem__) == (["d"], {})


def test_of_two_alone_the_worse_registered_is_blamed_and_the_other_named() -> None:
    assert blame({("a", "b"): 0.9}, LIMIT, {"a": 0.4, "b": 1.0}.__getitem__) == (["a"], {"a": "b"})


def test_two_that_agree_with_each_other_alone_are_outvoted() -> None:
    gaps = {("a", "b"): 0.01, ("a", "c"): 0.9, ("a", "d"): 0.9, ("b", "c"): 0.9, ("b", "d"): 0.9, ("c", "d"): 0.01}
    gaps |= {("c", "e"): 0.01, ("d", "e"): 0.01}
    blamed, _ = blame(gaps, LIMIT, lambda camera: 1.0)
    assert sorted(blamed) == ["a", "b"]
