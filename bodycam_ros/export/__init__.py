"""What was solved, and the body that it was solved with, in the formats of other programs."""
