"""Parameter estimation: residuals and sensitivities of many trials, least squares, fits."""
