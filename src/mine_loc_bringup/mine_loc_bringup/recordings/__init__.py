"""Public recordings of people with radios and inertial sensors, read into what our own devices would have reported."""
