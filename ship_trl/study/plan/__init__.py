"""The runs of a study: its settings, arms and jobs. No torch."""
