"""What all of mine_loc shares: integer time, framing, parameters, site model, geometry, error measures, the node base."""
