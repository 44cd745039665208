"""The factors of the graph: each with its residual, its Jacobian and the equation that it is."""
