"""Which runs a study consists of: what it is asked to be, and its jobs. No torch."""
