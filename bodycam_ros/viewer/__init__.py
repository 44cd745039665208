"""The body in a browser: looked at, and corrected."""
