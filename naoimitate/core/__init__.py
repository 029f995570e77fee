"""What every room shares: frames, errors, small geometry."""
