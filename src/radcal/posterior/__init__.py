"""Hierarchical model of the cells of an image, its sampling, and the posterior of the laws."""
