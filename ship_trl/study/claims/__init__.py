"""The paper's claims as contrasts, and the verdicts on them. No torch."""
