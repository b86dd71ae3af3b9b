"""Machine code: traced arithmetic to LLVM (SIMD), compiled and called."""
