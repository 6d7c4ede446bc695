"""Controllers on robots: the loop, its logs, and a simulated robot in a process of its own."""
