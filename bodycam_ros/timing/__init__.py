"""What time it is for every camera: where it was between its images, and how far its clock is off."""
