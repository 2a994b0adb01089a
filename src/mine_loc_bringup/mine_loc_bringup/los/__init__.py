"""Labelled recordings, training runs and reports of the LOS classifier."""
