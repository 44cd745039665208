"""Places that were not there, machines in them, and how a motion is moved there: of films and of files."""
