"""A player of episodes: the game picture, what the network sees, and the numbers behind each decision."""

import os

# A library does not greet on standard output; pygame does so when it is imported.
os.environ.setdefault("PYGAME_HIDE_SUPPORT_PROMPT", "1")
