"""The resistive exercise device: its moments, prescriptions for it, and the knee."""
