"""How exact the simulation is: against scipy, and in limits that the equations approach."""
