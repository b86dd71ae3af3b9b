"""The resistive exercise device: its moments, its prescriptions, and the strength of the knee."""
