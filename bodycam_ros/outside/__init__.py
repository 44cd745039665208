"""Static cameras: what they see of a body's surface (B 2.3-2.4)."""
