"""A solved bag, read once."""
