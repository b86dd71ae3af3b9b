"""Cache of compiled code on disk: location, permissions and signatures."""
