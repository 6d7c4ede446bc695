// The drive of one wheel, from the command that is sent to the torque on the wheel, without MuJoCo.
//
// In each substep n, at time n*h: latch and shape the command when due, tick the wheel law when due, move the
// setpoint linearly from w(k) to w(k+1), and hold it with a (PI) velocity servo:
//
//   w(k+1) = A w(k) + B w(k-1) + C w(k-2) + D r(k) + E r(k-1) + F r(k-2)          [rpm]
//   torque = kv (setpoint - speed) + ki integral(setpoint - speed) dt + J (setpoint's acceleration)   [N m]
//
// The motor may bound the step from w(k) to w(k+1). As the law's memory is the wheel's own speed, nothing winds up, unless
// the law asks again in the next tick for a share of what was beyond the bounds.
// The torque is limited to torque_limit_n_m. J is the inertia of the free wheel; fed forward, it makes the free wheel
// follow the setpoint without lag. A rotor is the part of J that the limit leaves alone. Friction of the wheel's
// bearing acts beside this torque.
//
// A substep is: chain_begin, chain_torques, the motion of the wheel under these torques, chain_end. The way from the
// command to r(k) is in set_point.h; the parameters are in parameters.h, the state is in drive.h. Around them stand the
// actuator plugin (mecanum_wheel.c) and the bench (bench.c). mecanum_env/wheel_drive is the same drive in Python; the
// tests hold the two equal bit for bit.

#ifndef MECANUM_CHAIN_H
#define MECANUM_CHAIN_H

#include "drive.h"

typedef struct {
  double asked;     // torque that the servo asks for [N m]
  double drive;     // the same, limited [N m]
  double custom;    // of a custom effect that loads the wheel [N m]
  double friction;  // of the wheel's bearing [N m]
} Torques;

// Advance the clocks, the law and the setpoint to the end of the substep; the rest of the drive is chain_end's.
void chain_begin(Drive* s, const double* p, const Substep* now);

// The torques to report: an implicit integrator subtracts kv times the coming change of speed from their sum.
Torques chain_torques(const Drive* s, const double* p, const Substep* now);

// Their sum.
double chain_reported(const Torques* t);

// Whether the servo alone moves the wheel behind the setpoint, as with most sets of parameters that a fit tries. The
// substep is then chain_begin and the motion under chain_plain_torque, with the same bits; the state behind the setpoint
// stays as it is, since nothing depends on it.
int chain_is_plain(const double* p);
double chain_plain_torque(const Drive* s, const double* p, const Substep* now);

// Take over the substep's motion: the wheel's speed at its end [rad/s], the drive's torque that was delivered (0 while
// actuation is disabled) and the whole torque that was reported [N m].
void chain_end(Drive* s, const double* p, const Substep* now, double asked, double delivered, double reported,
               double speed);

#endif
