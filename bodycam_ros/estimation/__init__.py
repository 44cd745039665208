"""From what cameras measure to the articulated body with covariance (A 4.3, B 3.2)."""
