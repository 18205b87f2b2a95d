"""The claims of Wang and Jin (2022), and the verdicts on them. No torch."""
