"""Make faults on purpose and check what survives: `python -m tests.faults`."""
