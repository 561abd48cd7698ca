"""Segmenters, one a file; the names are the file names with hyphens."""
