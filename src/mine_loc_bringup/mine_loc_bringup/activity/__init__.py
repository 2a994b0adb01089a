"""Labelled windows of recorded and simulated walks, of which the recognition of activities is learnt."""
