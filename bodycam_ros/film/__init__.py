"""A solved body as a film: a character in its place, or over images (A figures 1 and 8; B figures 7, 11)."""
