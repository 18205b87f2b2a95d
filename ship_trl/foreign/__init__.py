"""Encounters of other tools: found in tracks, brought to the simulator's size, and back."""
