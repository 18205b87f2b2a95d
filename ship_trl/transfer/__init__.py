"""Transfer: copy layers, rank source cases by similarity, store trained networks."""
