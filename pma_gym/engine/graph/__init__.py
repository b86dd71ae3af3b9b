"""The control step as traced arithmetic: command, sensors, reward, score, an exercise's person."""
