"""From a photo of a table to a scene: background, segmenters, clean-up, and connectors to masks made elsewhere."""
