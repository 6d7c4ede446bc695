// The friction of a robot's rollers where its wheels never slip: a force to the side.
//
// A roller turns as far as its wheel moves sideways, so that the friction of its bearing holds the wheel back in that
// direction: with N newtons, however fast, and with some newtons for each m/s. Below about the speed REST the constant
// part falls with the speed, as the integrator takes it as it is at the start of a substep.
// (mecanum_env/mjcf/sideways.py computes the numbers.)

#ifndef MECANUM_ROLLERS_H
#define MECANUM_ROLLERS_H

#include <math.h>

// For each wheel: constant part [N] and slope [N s/m] of its friction sideways; the distance of the front and of the
// rear wheels from the middle [m]; and the speed below which the constant part falls [m/s].
enum { RUB, DRAG, ARM, REST, N_ROLLERS };

// Add the force to the left [N] and the moment [N m] on a body that moves to the left [m/s] and turns [rad/s].
static inline void rollers_hold(const double* r, double left, double turn, double* force, double* moment) {
  if (!(r[RUB] > 0 || r[DRAG] > 0)) return;
  for (int end = -1; end <= 1; end += 2) {
    double speed = left + end * r[ARM] * turn;
    double held = 2 * ((r[RUB] > 0 ? r[RUB] * tanh(speed / r[REST]) : 0) + r[DRAG] * speed);
    *force -= held;
    *moment -= end * r[ARM] * held;
  }
}

#endif
