"""A world of cloth: a robot and a camera that need no hardware. Policies never import it, and it knows no predictor."""
