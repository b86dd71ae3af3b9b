"""A speed run as a document, as tables and as ratios with targets."""
