"""What the regulator's lag makes impossible in an exercise: three bounds."""
