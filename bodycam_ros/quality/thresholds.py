"""From when on a camera contradicts the body, and for how long it must."""

DOUBTFUL_GAP_M = 0.06
"""Two cameras that disagree by so much about the body are doubtful; good recordings stay below 0.045 in their worst
second."""

WRONG_GAP_M = 0.12
"""Beyond it a limb points elsewhere; lenses and names that are wrong show 0.14 and more."""

LEAST_STAY_S = 1.0
"""Half of this time must disagree; a wrong registration or blur passes sooner, and the solver interpolates it."""

WRONG_SHARE = 0.05
"""Of the time that a camera contradicts; shorter spells make a result doubtful, not wrong as a whole."""

LENS_SCALE = 0.007
"""Share by which landmarks lie farther out or in than the lens predicts; a focal length 2 % off shows as 0.010 to
0.017, good lenses as 0.0027 at most."""

LENS_CENTRE = 0.015
"""By how much the principal point is off, of half the width; 40 px show as 0.06 and more, good lenses as 0.005
at most."""

CLOCK_ERROR_S = 0.008
"""A camera whose places fit the body better this much earlier or later is off, as far as stamps are one instant."""

LEAST_REGISTERED = 0.05
"""Share of a camera's images; below it the camera has not been registered."""

EARLY_END_S = 1.0
"""A camera that is registered for the last time this long before the others ends early."""

BLIND_S = 1.0
"""A camera alone on its segment that is not registered for longer leaves it unobserved."""

JUDGED_HZ = 10.0
"""Rate of the states that are judged; a wrong camera stays wrong."""

LIVE_SPAN_S = 30.0
"""How far a live verdict looks back: it ends this long after its cause."""

LIVE_INTERVAL_S = 3.0
"""Between two live verdicts; one takes some hundredths of a second, in which nothing is solved."""
