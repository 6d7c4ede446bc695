// The planar plant without MuJoCo: a robot without slip that is driven from rest through one run.
//
// The body moves as MuJoCo's integrator "implicitfast" moves that of mecanum_env.mjcf.planar_spec; the formula is in
// mecanum_env/batch/plant.py, which moves many robots at once, and the tests hold this equal to MuJoCo. Programs call it
// through ctypes (mecanum_env/plugin/library.py), which releases Python's lock.

#include <math.h>
#include <string.h>

#include "chain.h"
#include "rollers.h"

#define LARGEST 1e10  // speeds beyond this have diverged, as for MuJoCo
#define WHEELS 4

// Numbers of a body in its own axes, in the order of mecanum_env.batch.numbers.BODY.
typedef struct {
  double gear[3];                       // wheel speed per velocity forward and left [1/m], and per yaw rate
  double m00, m01, m02, m11, m12, m22;  // inverse of the inertia that an implicit step moves
  double simple, ahead, aside;          // whether MuJoCo drops what couples the world's axes, and the inertia then
  double moment_x, moment_y;            // mass times the offset of its centre [kg m]
  double weight, gravity_x, gravity_y;  // mass that gravity pulls [kg], gravity along the world's axes [m/s^2]
  double damping, damping_turn;         // viscous friction along the axes and in turning
  double rollers[N_ROLLERS];            // what the rollers' friction is to the side, see rollers.h
} Body;

// How fl, fr, rl and rr turn when the body moves forward, to the left, and counter-clockwise.
static const double MIXING[WHEELS][3] = {{1, -1, -1}, {1, 1, 1}, {1, 1, -1}, {1, -1, 1}};

static void wheel_speeds(const Body* b, const double velocity[3], double speeds[WHEELS]) {
  for (int i = 0; i < WHEELS; i++) {
    speeds[i] = 0;
    for (int k = 0; k < 3; k++) speeds[i] += MIXING[i][k] * (b->gear[k] * velocity[k]);
  }
}

// Change a velocity in the body's axes by forces along them and a moment, over h seconds.
static void move(const Body* b, double h, double cosine, double sine, const double force[3], double velocity[3]) {
  double along = force[0], across = force[1], moment = force[2];
  if (b->simple) {
    double c2 = cosine * cosine, s2 = sine * sine;
    double x = (cosine * along - sine * across) / (b->ahead * c2 + b->aside * s2);
    double y = (sine * along + cosine * across) / (b->ahead * s2 + b->aside * c2);
    velocity[0] += h * (cosine * x + sine * y);
    velocity[1] += h * (cosine * y - sine * x);
    velocity[2] += h * (b->m22 * moment);
  } else {
    velocity[0] += h * (b->m00 * along + b->m01 * across + b->m02 * moment);
    velocity[1] += h * (b->m01 * along + b->m11 * across + b->m12 * moment);
    velocity[2] += h * (b->m02 * along + b->m12 * across + b->m22 * moment);
  }
}

// Drive a robot from rest at the origin in `steps` steps of h [s]. Its wheels have the `parameters` (4, N_NUMBERS), its
// body the numbers `body`; `ctrl` (steps, 4) is what the wheels are commanded [rpm] in each step, and `lost` (steps) the
// voltage that the supply has lost, or NULL for none. Results, the start included: `pose` x, y [m], yaw [rad] in the
// world, and `twist`, velocity in the body's axes [m/s] and yaw rate [rad/s], (steps + 1, 3) each, and the wheels'
// `speeds` [rpm], (steps + 1, 4). Returns the steps before the state diverged, else all of them.
EXPORT int64_t mecanum_planar(int64_t steps, double h, const double* parameters, const double* body,
                              const double* ctrl, const double* lost, double* pose, double* twist, double* speeds) {
  Body b;
  memcpy(&b, body, sizeof b);
  Drive drives[WHEELS];
  memset(drives, 0, sizeof drives);
  double place[3] = {0}, velocity[3] = {0}, before[WHEELS] = {0}, after[WHEELS];
  memcpy(pose, place, sizeof place);
  memcpy(twist, velocity, sizeof velocity);
  memcpy(speeds, before, sizeof before);
  for (int64_t n = 0; n < steps; n++) {
    double cosine = cos(place[2]), sine = sin(place[2]), push[3] = {0};
    Substep now[WHEELS];
    Torques torques[WHEELS];
    for (int i = 0; i < WHEELS; i++) {
      const double* p = parameters + i * N_NUMBERS;
      now[i] = (Substep){ctrl[WHEELS * n + i], before[i], h, 1, lost ? lost[n] : 0};
      chain_begin(&drives[i], p, &now[i]);
      torques[i] = chain_torques(&drives[i], p, &now[i]);
      for (int k = 0; k < 3; k++) push[k] += MIXING[i][k] * chain_reported(&torques[i]);
    }
    double rate2 = velocity[2] * velocity[2];
    double pulled_ahead = cosine * b.gravity_x + sine * b.gravity_y;
    double pulled_aside = cosine * b.gravity_y - sine * b.gravity_x;
    double force[3] = {
        b.gear[0] * push[0] - b.damping * velocity[0] + b.moment_x * rate2 + b.weight * pulled_ahead,
        b.gear[1] * push[1] - b.damping * velocity[1] + b.moment_y * rate2 + b.weight * pulled_aside,
        b.gear[2] * push[2] - b.damping_turn * velocity[2] + b.moment_x * pulled_aside - b.moment_y * pulled_ahead,
    };
    rollers_hold(b.rollers, velocity[1], velocity[2], &force[1], &force[2]);
    move(&b, h, cosine, sine, force, velocity);
    wheel_speeds(&b, velocity, after);
    for (int i = 0; i < WHEELS; i++)
      chain_end(&drives[i], parameters + i * N_NUMBERS, &now[i], torques[i].asked, torques[i].drive,
                chain_reported(&torques[i]), after[i]);
    // The velocity stays in the world's axes, as the body turns under it.
    double world[2] = {cosine * velocity[0] - sine * velocity[1], sine * velocity[0] + cosine * velocity[1]};
    place[0] += h * world[0];
    place[1] += h * world[1];
    place[2] += h * velocity[2];
    double c = cos(place[2]), s = sin(place[2]);
    velocity[0] = c * world[0] + s * world[1];
    velocity[1] = c * world[1] - s * world[0];
    for (int k = 0; k < 3; k++)
      if (!(fabs(velocity[k]) <= LARGEST)) return n;
    wheel_speeds(&b, velocity, before);
    memcpy(pose + 3 * (n + 1), place, sizeof place);
    memcpy(twist + 3 * (n + 1), velocity, sizeof velocity);
    for (int i = 0; i < WHEELS; i++) speeds[WHEELS * (n + 1) + i] = before[i] / RAD_S_PER_RPM;
  }
  return steps;
}
