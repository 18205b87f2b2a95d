"""A player of episodes: the game picture, what the network sees, and the numbers behind each decision."""
