"""Search and decision: which set of effects explains the residual, and how sure that is."""
