"""One run: plan it, train it, log it, and write its results."""
