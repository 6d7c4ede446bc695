// The way of a command through the drive up to the law's input r(k).

#ifndef MECANUM_SET_POINT_H
#define MECANUM_SET_POINT_H

#include "drive.h"

// A command [rpm] or voltage [V]; NaN and absurd values count as 0, as for MuJoCo's own actuators.
double set_point_sane(double given);

// Latch the command that is sent [rpm], shaped as the drive does it.
void set_point_latch(Drive* s, const double* p, const Substep* now);

// The law's input r(k) [rpm]: the mean over the coming tick of the delayed command behind the acceleration limit. Only
// commands latched by the start of the tick count.
double set_point_input(Drive* s, const double* p);

// Start the clocks of commands and ticks anew; the last command holds on.
void set_point_restart(Drive* s);

#endif
