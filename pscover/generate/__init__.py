"""Instances made to order, each reproducible from its arguments and a seed; one kind a file."""
