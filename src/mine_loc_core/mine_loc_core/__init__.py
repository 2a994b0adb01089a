"""What all of mine_loc shares: time, framing, parameters, site model, geometry, error measures, node base."""
