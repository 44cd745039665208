"""Is a recording good enough, and may a result be used: one kind of finding for each question."""
