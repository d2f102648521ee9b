"""Speed and memory of the parts, beside other libraries and known optima."""
