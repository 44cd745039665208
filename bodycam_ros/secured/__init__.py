"""Who may say and hear what in the live graph, and the keys that hold everybody to it (SROS 2)."""
