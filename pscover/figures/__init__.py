"""Figures, one a file; matplotlib is imported only here."""
