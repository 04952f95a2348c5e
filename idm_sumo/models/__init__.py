"""Equations only, as compiled scalar kernels."""
