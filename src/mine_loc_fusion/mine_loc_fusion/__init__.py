"""Time alignment and fusion: one pose per person."""
