// The bench without MuJoCo: free wheels on hinges, for many sets of parameters and many runs in one call.
//
// The wheel's motion is what MuJoCo's integrator "implicitfast" makes of one hinge: the tests hold the two equal bit
// for bit. Programs call this through ctypes (mecanum_env/plugin/library.py), which releases Python's lock.

#include <math.h>
#include <string.h>

#include "chain.h"

#define LARGEST 1e10  // speeds and accelerations beyond this have diverged, as for MuJoCo
#define EARLY 1e-9    // time by which a command may be early [s]; it absorbs the rounding of n h

typedef struct {
  int64_t steps;           // substeps to simulate
  int64_t commands;        // number of commands
  const double* times;     // when they are given, from the start on, increasing [s]
  const double* values;    // held until the next [rpm]
  double initial;          // steady speed before the start, and command before the first [rpm]
  double gap_share;        // place of the motor in the backlash before a start at rest, from -1 to 1
  const double* lost;      // voltage that the supply has lost in each substep [V]; NULL: none
} Run;

static void start_steady(Drive* s, const double* p, double speed, double gap_share) {
  memset(s, 0, sizeof *s);
  // The motor of a turning wheel has crossed the backlash, unless an elastic filling is at rest in its middle.
  if (!(p[GAP_SWING] > 0)) s->gap = (speed > 0 ? 1 : speed < 0 ? -1 : gap_share) * p[GAP] / 2;
  if (speed == 0) return;
  s->w0 = s->w1 = s->w2 = s->r1 = s->r2 = s->ramp = s->sent = speed;
  s->setpoint = speed * RAD_S_PER_RPM;
  for (int i = 0; i < RING; i++) s->command[i] = speed;
}

// Simulate one run; return the number of substeps before it diverged. Speeds [rpm] are those at 0, h, 2 h ...
static int64_t simulate(const double* p, double inertia, double damping, double h, const Run* run, double* speeds) {
  // The inertia that an implicit step moves.
  const double moved = inertia + h * (p[SERVO] + damping);
  const int plain = chain_is_plain(p);
  Drive s;
  start_steady(&s, p, run->initial, run->gap_share);
  Substep now = {run->initial, run->initial * RAD_S_PER_RPM, h, 1, 0};
  int64_t given = 0;
  for (int64_t n = 0; n < run->steps; n++) {
    speeds[n] = now.speed / RAD_S_PER_RPM;
    for (; given < run->commands && run->times[given] <= n * h + EARLY; given++) now.command = run->values[given];
    if (run->lost) now.lost_v = run->lost[n];
    chain_begin(&s, p, &now);
    Torques t = {0};
    if (!plain) t = chain_torques(&s, p, &now);
    double reported = plain ? chain_plain_torque(&s, p, &now) : chain_reported(&t);
    double torque = reported - damping * now.speed;
    double speed = now.speed + h * (torque * (1 / moved));
    if (!(fabs(torque / inertia) <= LARGEST && fabs(speed) <= LARGEST)) {
      for (int64_t i = n + 1; i <= run->steps; i++) speeds[i] = NAN;
      return n;
    }
    if (!plain) chain_end(&s, p, &now, t.asked, t.drive, reported, speed);
    now.speed = speed;
  }
  speeds[run->steps] = now.speed / RAD_S_PER_RPM;
  return run->steps;
}

// Simulate every run with every set of parameters: row i of `parameters` (sets, N_NUMBERS) drives a wheel of the
// inertia [kg m^2] and viscous damping [N m s/rad] in row i of `wheels` (sets, 2), in steps of h [s]. Run j has the
// commands first[j] .. first[j + 1] - 1 of `times` and `values`. `lost` (sum of steps), run after run, is the voltage
// that the supply has lost in each substep [V], or NULL for none. Results: `speeds` (sets, sum of steps + 1), run after
// run, and `reached` (sets, runs), the substeps before the state diverged, else all of them.
EXPORT void mecanum_bench(int64_t sets, int64_t runs, double h, const double* parameters, const double* wheels,
                          const int64_t* first, const double* times, const double* values, const int64_t* steps,
                          const double* initial, const double* gap_share, const double* lost, double* speeds,
                          int64_t* reached) {
  for (int64_t i = 0; i < sets; i++) {
    const double* given = lost;
    for (int64_t j = 0; j < runs; j++) {
      Run run = {steps[j],          first[j + 1] - first[j], times + first[j],
                 values + first[j], initial[j],              gap_share[j],     given};
      if (given) given += steps[j];
      *reached++ = simulate(parameters + i * N_NUMBERS, wheels[2 * i], wheels[2 * i + 1], h, &run, speeds);
      speeds += run.steps + 1;
    }
  }
}
