"""A study in three small files, and its folder from them. No torch."""
