"""What a closed chain can do before anything is solved: freedoms, rank, what is said twice and what cannot be (B 3)."""
