"""What is in a bag that was solved: the body over time, and the cameras that it was solved from."""
