"""Bytes from outside to domain values and back: missions, maps, event logs."""
