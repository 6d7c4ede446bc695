"""The bench of the zoo: drives of random topology and size, simulated by equations of their own."""
