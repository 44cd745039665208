"""What equipment does to a result: a recording solved with it beside the same one solved without (B figures 9, 12)."""
