"""Controllers of the exercise device, and the resistance and the observers that they share."""
