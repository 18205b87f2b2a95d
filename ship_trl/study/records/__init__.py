"""Finished runs: one as a record, many as tables small enough to commit, and a folder from them. No torch."""
