"""The slide: its mass, its friction, the hand at it, and where a free one starts."""
