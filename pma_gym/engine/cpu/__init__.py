"""Writers of the control step and of resets for the processor, in SIMD lanes."""
