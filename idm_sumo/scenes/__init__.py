"""Windows of drivers and the traffic around them."""
