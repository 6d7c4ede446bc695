"""The robots of the zoo: planar bodies on roller wheels, simulated by equations of their own."""
