"""What several tests stand on: bodies, motions, recordings and graphs of which everything is known."""
