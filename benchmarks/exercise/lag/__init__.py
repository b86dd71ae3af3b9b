"""Three bounds on the error of an exercise that the regulator's lag sets."""
