"""The control step as traced arithmetic: command, sensors, reward, score, exercise operator."""
