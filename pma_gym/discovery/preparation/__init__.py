"""Before anything is fitted: trials, their noise and floors, and whitened residuals."""
