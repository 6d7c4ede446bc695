"""The drive around the wheel law, from the command to the torque on the wheel, for many wheels at a time.

It is the reference of the C code in `mecanum_env.plugin`: tests hold both equal to the bit.

chain         a whole drive, one substep after the other; `free_wheel` runs it on a bench
drive         the parameters of a drive, and what it makes of a command; `parameters` puts them in a row,
              and `many` are several drives as one
inputs        from the commands that are sent to the inputs of the law
link          the delay of each command, its jitter, and commands that are lost
set_point     from a command to the set-point, as functions of numbers; `shaping` does it for a latched one
ramp          how fast the set-point may change
motor_bounds  what the torque of a motor and its supply leave of the law's step
light_wheel   backlash that the wheel crosses by itself, between the law and the servo
servo         the servo behind the set-point, with what loads it: `wheel_load` and `custom_load`
formula       formulas of custom effects, checked and turned into a `program` that runs in the drive
parts         which of these parts any of many drives has
"""
