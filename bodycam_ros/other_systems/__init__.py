"""Motions that other systems captured: their files, their names, their clocks."""
