"""Compensation of named effects around any controller: of drives on commands, of sensors on observations."""
