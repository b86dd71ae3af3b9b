"""The cable between pulley and slide, and what hangs on the pulley beside it."""
