"""The exercise device as a design tool: moments of configurations, and the smallest that serves."""
