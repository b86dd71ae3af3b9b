"""Simulators of rigs' motions and forces: integrators of this folder, and MuJoCo."""
