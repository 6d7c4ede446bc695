"""Drives and robots drawn at random, with hidden effects: the yardstick of the gap workflow.

drives     drives drawn at random, and their simulation
robots     robots drawn at random, and theirs; neither imports the simulator that they judge
cases      what is hidden in which of them, and the logs of both states
nominal    the model fitted to the nominal logs
run        cases of some seeds: `work` runs them, `seeds` says which may be used, `sources` with which code
outcome    what the study of a case said, and whether that is right
settle     the experiments that studies ask for; `recorders` drive them, `settled` is what came of it
page       the results: `tables`, `settled_table`, `goals` and `power` curves
calibrate  what the cases say about the thresholds of a verdict; `calibration` computes it
"""
