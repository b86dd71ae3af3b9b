"""Compiled code on disk: where it is kept, who may have written it, who signed it."""
