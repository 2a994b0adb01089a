"""DWM1000 wire formats, range correction, position solving."""
