"""The drive: from motor voltage to cable load, with the rotor and the drive's nonlinearities."""
