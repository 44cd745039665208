"""What images of another size than their lens is for tell of the mode that a camera recorded in."""

_SAME = 0.01
"""Of the ratio of width to height: rounding to even numbers of pixels."""


def mode_of_size(lens: tuple[int, int], images: tuple[int, int]) -> str:
    """The likely cause, and what to do, for a person.

    Args:
        lens: width and height that it is for [px].
        images: width and height that they have [px].
    """
    of_lens, of_images = lens[0] / lens[1], images[0] / images[1]
    if abs(of_images / of_lens - 1.0) < _SAME:
        way = "smaller" if images[0] < lens[0] else "larger"
        return (
            f"the same shape, {way}: most likely another resolution was set; record in the lens' own, or measure the "
            "lens in this one (bodycam lens)"
        )
    if abs(of_images * of_lens - 1.0) < _SAME:
        return "height for width: the camera was held, or its driver turns, by 90 degrees; turn it back"
    cut = "above and below" if of_images > of_lens else "at the sides"
    return (
        f"another shape: most likely a mode that cuts the picture {cut}, such as 16:9 in place of 4:3; record in the "
        "lens' mode, or measure the lens in this one (bodycam lens)"
    )
