"""How good an output was: measures against truth, bounds on them, and reports."""
