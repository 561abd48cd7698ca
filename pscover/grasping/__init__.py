"""From a scene of segmented garments to an instance of grasp candidates (paper, sections 2 and 4)."""
