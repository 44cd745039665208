"""Static cameras: where they stand, and what they see of a body's surface (B 2)."""
