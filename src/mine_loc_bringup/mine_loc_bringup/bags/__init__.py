"""Bags (rosbag2): written so that a power cut costs a second at most, and opened again when one happened."""
