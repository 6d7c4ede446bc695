"""Undoing named effects around any controller: what drives do to commands, sensors to observations."""
