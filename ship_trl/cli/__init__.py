"""The verbs of the command line: one file each, and one way of reading arguments."""
