"""Masks made elsewhere, in and out: one format a file."""
