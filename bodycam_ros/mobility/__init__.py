"""The mobility of a body with equipment: degrees of freedom, rank, redundant and conflicting constraints (B 3)."""
