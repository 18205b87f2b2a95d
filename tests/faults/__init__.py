"""Make faults on purpose and check what survives."""
