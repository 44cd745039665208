"""The stages wired once, for the live graph, a replay and other programs."""
