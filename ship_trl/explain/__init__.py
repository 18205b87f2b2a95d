"""What networks have learned to see: features by layer, probes, similarity, saliency, on one page."""
