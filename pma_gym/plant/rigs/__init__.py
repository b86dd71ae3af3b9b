"""The rigs that a model can be of, one file each: their ports, states and balances."""
