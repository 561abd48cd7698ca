"""Predictors fitted to logged grasps: every recorded run tells which garments its grasps took away."""
