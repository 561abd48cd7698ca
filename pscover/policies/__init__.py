"""Policies: one a file, registered by lying here; files that begin with _ are what several of them share."""
