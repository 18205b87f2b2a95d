"""Interactive windows: watch policies, or steer a ship."""
