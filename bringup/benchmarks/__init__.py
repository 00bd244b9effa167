"""What is measured of the loop and of its parts."""
