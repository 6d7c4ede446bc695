// The state of a wheel's drive, and what it meets in a substep.

#ifndef MECANUM_DRIVE_H
#define MECANUM_DRIVE_H

#include "parameters.h"

#define RAD_S_PER_RPM (2.0 * 3.141592653589793 / 60.0)

typedef struct {
  double substeps, ticks, latches;                 // counts since the clocks started
  double timestep, sample_period, command_period;  // the clocks in use [s]; another value restarts them
  double w0, w1, w2, r1, r2;                       // the law's memory [rpm]: w0 = w(k+1), w1 = w(k)
  double ramp;                                     // command behind the acceleration limit at the tick's end [rpm]
  double setpoint;                                 // setpoint at the end of the last substep [rad/s]
  double rise;                                     // change of the setpoint in the last substep [rad/s]
  double integral;                                 // integral of setpoint - speed of the motor [rad]
  double change;                                   // change of the wheel's speed in the last substep [rad/s]
  double gap;                                      // motor minus wheel in the backlash, +- half of it [rad]
  double load;                                     // torque of everything else on the wheel, smoothed [N m]
  double angle;                                    // turned by the wheel since the start [rad]
  double slope;                                    // the S-curve's rate of change at the end of the tick [rpm/s]
  double sent;                                     // the last command that was not lost, before it is shaped [rpm]
  double excess;                                   // by how much the law's last step was beyond the motor's bounds [rpm]
  double command[RING];                            // latched command j at j modulo RING [rpm]
  double arrival[RING];                            // when it arrives, if the delay jitters [s]
} Drive;

// What the drive meets in a substep.
typedef struct {
  double command;   // command that is sent [rpm]
  double speed;     // the wheel's speed at the start of the substep [rad/s]
  double timestep;  // h [s]
  int implicit;     // whether the integrator subtracts kv times the coming change of speed from the torque
  double lost_v;    // voltage of the supply below that at the start [V]; 0 where it is not known
} Substep;

#endif
