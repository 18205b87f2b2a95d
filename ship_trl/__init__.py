"""ship_trl: work process transfer reinforcement learning in ship collision avoidance."""

__version__ = "0.1.0"
