"""What computes the motions and forces of rigs: integrators of this folder, and MuJoCo."""
