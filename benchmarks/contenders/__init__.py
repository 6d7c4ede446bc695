"""What `benchmarks/peers.py` compares: this project's parts and what a user would pick instead."""
