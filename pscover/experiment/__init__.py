"""Experiments: the same scenes for every policy, counted by what is true rather than by what is seen."""
