"""Runs a study through Hydra's launchers, and shows its progress. No torch."""
