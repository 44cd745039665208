"""How well a solved recording agrees with what another system captured (A section 5.1)."""
