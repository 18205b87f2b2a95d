"""Grids of runs by Hydra: check them, launch them, sweep."""
