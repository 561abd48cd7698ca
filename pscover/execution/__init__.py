"""From plans to a clear table: the cycle that drives a robot, what happened told as events, and episodes on record."""
