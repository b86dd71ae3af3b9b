"""Readers of tables: one kind of file a module, bytes to cells, without any meaning."""
