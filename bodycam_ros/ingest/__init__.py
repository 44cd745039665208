"""Videos of cameras that were started by hand, brought to one time and into one bag (A 3)."""
