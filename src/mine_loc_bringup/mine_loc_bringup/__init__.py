"""The node graph, launch files and the mine-loc command."""
