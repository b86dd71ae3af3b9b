"""What a drive moves that imposes a motion: the motion, and what resists it beside a muscle."""
