"""What the live graph publishes on /diagnostics; a replay computes the same."""
