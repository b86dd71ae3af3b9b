"""How episodes start: pressure, station and disturbances drawn, the plant at equilibrium."""
