"""The interactive window: watching policies and steering a ship."""
