"""Types, values and checks of a configuration. No torch."""
