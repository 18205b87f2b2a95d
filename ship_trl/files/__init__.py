"""What lies on disk: atomic writes, files from outside, results and curves. No torch."""
