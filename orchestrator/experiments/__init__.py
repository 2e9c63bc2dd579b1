"""Several runs at once: comparisons, convergence, the study of a paper."""
