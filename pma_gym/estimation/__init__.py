"""Parameter estimation: residuals and sensitivities of trials, least squares, fits."""
