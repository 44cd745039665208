"""Boards to print, and lenses measured by pictures of them."""
