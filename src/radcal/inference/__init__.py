"""Inference of a law from pixels: moments of bins, misfit, priors, fit of the law alone."""
