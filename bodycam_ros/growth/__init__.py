"""How the map grows by what registered cameras see: relative registration (A 4.1, second half)."""
