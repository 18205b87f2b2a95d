"""A study's runs through Hydra's launchers: what is missing, how long it takes, how far it is. No torch."""
