"""A law of transfer: what a source is worth to a target, by the tables of the study of sources."""
