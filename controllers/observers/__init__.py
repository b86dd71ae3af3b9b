"""State estimators: Kalman filters, extended state observers and their gains."""
