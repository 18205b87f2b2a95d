"""Transfer: copy and freeze layers, rank sources by similarity, keep trained networks."""
