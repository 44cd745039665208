"""Static calibrated cameras that look at the body from outside (B 2)."""
