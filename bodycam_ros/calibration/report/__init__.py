"""A calibration's diagnosis for people: on the terminal, as a page with a picture, and in the body file."""
