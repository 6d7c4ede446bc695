"""Predicted against measured: what a model simulates for a log, the residual, its noise, and fits of it."""
