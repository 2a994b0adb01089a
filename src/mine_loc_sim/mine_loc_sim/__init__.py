"""A mine to test in: channel, walkers, emulators that speak bytes."""
