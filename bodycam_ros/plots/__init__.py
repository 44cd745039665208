"""Pictures and pages of maps and bodies, and what all pictures share."""
