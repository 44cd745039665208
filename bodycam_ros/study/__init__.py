"""Many recordings as one workflow: the same commands as by hand, run by Snakemake, and a page over all of them."""
