"""From result files to verdicts: metrics, statistics, hypotheses, figures, report. No torch."""
