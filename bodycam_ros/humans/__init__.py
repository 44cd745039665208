"""The body as REP-155 describes humans: joints with one axis each, named and ordered as in human_description."""
