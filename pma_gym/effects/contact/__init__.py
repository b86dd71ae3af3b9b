"""Rigs whose drive imposes a motion: that motion, and the forces that resist it beside a muscle."""
