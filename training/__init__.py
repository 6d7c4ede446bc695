"""Controllers of the Mecanum robot: their training, evaluation, certificates and videos."""
