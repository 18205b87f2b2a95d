"""The study of sources: what each case's network is worth on every other case, and what predicts it."""
