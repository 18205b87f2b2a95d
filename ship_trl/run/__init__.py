"""One run: what is planned, its training, what is shown and written down of it."""
