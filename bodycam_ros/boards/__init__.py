"""Boards: to print, to describe, and to find in pictures."""
