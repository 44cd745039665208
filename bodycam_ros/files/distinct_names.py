"""Names of segments and cameras, as files and other programs allow them, still one for each."""

from collections.abc import Callable, Iterable


def distinct_names(names: Iterable[str], allowed: Callable[[str], str]) -> dict[str, str]:
    """Each name -> its allowed form; names that would have the same one get a number.

    A name that is allowed as it is keeps itself. Capitals do not count: some file systems ignore them.

    Args:
        names: all different.
        allowed: gives the allowed form of one.
    """
    given = list(names)
    forms: dict[str, str] = {}
    taken: set[str] = set()
    for name in sorted(given, key=lambda name: allowed(name) != name):
        form, number = allowed(name), 1
        while form.lower() in taken:
            number += 1
            form = f"{allowed(name)}_{number}"
        taken.add(form.lower())
        forms[name] = form
    return {name: forms[name] for name in given}
