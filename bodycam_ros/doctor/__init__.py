"""Whether a recording is good enough, before it is solved and before everybody goes home: one check a file."""
