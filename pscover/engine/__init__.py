"""Compiled kernels of our own optimiser (numba, cached) and their typed faces: one idea a file."""
