"""The station once more: a leapfrog integrator with its own forms of every law; numpy and scipy."""
