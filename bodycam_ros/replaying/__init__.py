"""The offline replay: the pipeline over a recorded bag, on all cores, deterministic."""
