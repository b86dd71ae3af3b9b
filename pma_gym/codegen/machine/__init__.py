"""Machine code: traced arithmetic to LLVM (SIMD) and PTX, compiled and called."""
