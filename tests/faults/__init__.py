"""Faults made on purpose, and what must survive each: `python -m tests.faults`."""
