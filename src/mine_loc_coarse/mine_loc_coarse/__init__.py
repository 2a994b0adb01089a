"""Coarse regions from direction-finding monitors."""
