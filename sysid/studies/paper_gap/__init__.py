"""What the paper's robot has and its model lacks: effects that reproduce the six figures of its section 4.5.

`python -m sysid.studies.paper_gap` searches and writes the tables.
"""
