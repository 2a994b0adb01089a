"""The demonstration: a recording played as bytes into serial lines, the live graph, a report against truth."""
