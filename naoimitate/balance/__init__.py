"""Balance: offset, landing, planted feet, and the retargeting of the feet as published."""
