"""Which source for which target: measures of similarity that look at cases and at networks."""
