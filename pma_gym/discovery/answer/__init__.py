"""The diagnosis as it is handed out: put together from what the steps computed."""
