"""The formulation study: what each formulation costs an engine, what its promise costs in grasps, and whether it is kept."""
