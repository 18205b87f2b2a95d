"""What the pipeline costs, beside peers that do the same work on the same processor at the same time."""
