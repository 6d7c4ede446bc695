"""Certifying a controller: fixed episodes on many plants, figures with intervals, pass or fail.

plants     the robots that it is played on
"""
