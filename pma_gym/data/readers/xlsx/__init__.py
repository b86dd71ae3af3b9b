"""XLSX workbooks as tables, read as a stream."""
