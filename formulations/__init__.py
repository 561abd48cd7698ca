"""Formulations of probabilistic set cover, one file each; the mathematics is in each file's docstring."""
