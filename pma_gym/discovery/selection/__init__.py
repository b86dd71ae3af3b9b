"""Which candidates or parameters are selected, and what rivals explain about equally."""
