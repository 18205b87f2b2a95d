"""Policies by name: without training, of a file, bundled with the package, or your own."""
