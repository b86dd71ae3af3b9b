"""The diagnosis of free rigs by one likelihood: that of the innovations of a Kalman filter."""
