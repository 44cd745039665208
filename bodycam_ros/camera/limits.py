"""Where any lens ends."""

NEAREST = 1e-9
"""A point closer to the projection centre has no direction [m]."""

FARTHEST = 1e100
"""Beyond it squares overflow [m]."""

EDGE = 1e-9
"""Of an angle [rad] or radius, the rounding allowed at the cone's edge: what was unprojected projects again."""
