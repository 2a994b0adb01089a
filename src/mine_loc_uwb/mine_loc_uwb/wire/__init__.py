"""What DW1000 devices say over their serial line, both ways: one file a format, `detect` chooses among them."""
