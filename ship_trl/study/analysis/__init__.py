"""From result files to contrasts: what is measured of a run, and its statistics. No torch."""
