"""Encounters of other tools: their files in, and episodes out. No torch."""
