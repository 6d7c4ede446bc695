"""Which effects reproduce the six numbers that the paper prints of its robot (section 4.5).

`python -m sysid.studies.paper_gap` searches and writes the tables.
"""
