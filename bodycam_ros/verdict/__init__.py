"""Whether a solved recording may be used: which camera contradicts the body, and why it likely does."""
