// The drive of one wheel; chain.h says what it is.

#include "chain.h"
#include "set_point.h"

#include <math.h>

#define TINY 1e-15          // least inertia of a wheel [kg m^2]
#define LOAD_SMOOTHING 0.1  // share of a change of the load that its estimate follows in a substep
#define STILL 1e-9          // difference of speeds [rad/s] that is none
#define ROOT_STEPS 12       // of the search for the speed at which a steep custom load and the drive agree
#define UNLIMITED 1e10      // torque limit [N m] that means none, as on the bench
#define LEAST_SUPPLY 1e-3   // share of the supply's speed that is left at any voltage

static double clip(double x, double low, double high) { return x < low ? low : x > high ? high : x; }

// ---------------------------------------------------------------------------------------- command to setpoint

static void restart_clocks(Drive* s, double h, double tau, double T) {
  set_point_restart(s);
  s->substeps = 0;
  s->timestep = h, s->sample_period = tau, s->command_period = T;
  s->change = 0;  // that of a substep of the old length
}

// The speed [rpm] at which the supply leaves the motor no torque at its present voltage; 0: no such limit.
static double supplied(const double* p, const Substep* now) {
  return p[SUPPLY] * fmax(LEAST_SUPPLY, 1 - p[SUPPLY_PER_VOLT] * now->lost_v);
}

// The speed w(k+1) [rpm] that the motor reaches where the law asks for `wanted`, from w(k) = `speed`.
//
// A torque limit bounds the change, with another bound where it slows the wheel. The supply bounds it by the line of a
// motor at full duty, forwards or in reverse: it falls to 0 at a speed which is so never passed.
static double reached(const double* p, const Substep* now, double speed, double wanted) {
  double rise = p[DRIVE_RISE] * p[SAMPLE_PERIOD], brake = p[DRIVE_BRAKE] * p[SAMPLE_PERIOD];
  if (!(brake > 0)) brake = rise;
  double up = speed < 0 ? brake : rise, down = speed > 0 ? brake : rise;
  double low = down > 0 ? speed - down : wanted, high = up > 0 ? speed + up : wanted;
  if (p[SUPPLY] > 0) {
    double supply = supplied(p, now);
    low = fmax(low, speed - p[SUPPLY_SHARE] * (supply + speed));
    high = fmin(high, speed + p[SUPPLY_SHARE] * (supply - speed));
  }
  return clip(wanted, low, high);
}

// Whether the backlash is crossed before the servo, by a wheel that nothing but the gap and its own friction moves.
static int is_light(const double* p) { return p[GAP] > 0 && p[GAP_KIND] == LIGHT; }

// The speed [rad/s] of such a wheel a substep after it was the setpoint.
//
// An elastic filling of the gap pulls it after the motor, and a dry friction stops it and never turns it. At the ends
// of the gap the two touch, without a bounce.
static double crossing(Drive* s, const double* p, double h, double motor) {
  double half = p[GAP] / 2, swing = p[GAP_SWING], wheel = s->setpoint;
  double free = wheel + h * (swing * swing * s->gap + 2 * p[GAP_DAMPING] * swing * (motor - wheel));
  double stopped = h * p[GAP_SLOWING];
  double speed = fabs(free) <= stopped ? 0 : free - copysign(stopped, free);
  double before = s->gap, position = before + h * (motor - speed);
  s->gap = clip(position, -half, half);
  return s->gap == position ? speed : motor - (s->gap - before) / h;
}

void chain_begin(Drive* s, const double* p, const Substep* now) {
  const double h = now->timestep, tau = p[SAMPLE_PERIOD], T = p[COMMAND_PERIOD];
  if (s->timestep != h || s->sample_period != tau || s->command_period != T) restart_clocks(s, h, tau, T);
  double time = s->substeps * h;
  for (int i = 0; i < MAX_EVENTS && time >= s->latches * T - EPS * T; i++) set_point_latch(s, p, now);
  for (int i = 0; i < MAX_EVENTS && time >= s->ticks * tau - EPS * tau; i++) {
    double r = set_point_input(s, p);
    double w = p[LAW_A] * s->w0 + p[LAW_B] * s->w1 + p[LAW_C] * s->w2 + p[LAW_D] * r + p[LAW_E] * s->r1 +
               p[LAW_F] * s->r2;
    double wanted = w + p[LAW_WINDUP] * s->excess;
    w = reached(p, now, s->w0, wanted);
    s->excess = wanted - w;
    s->w2 = s->w1, s->w1 = s->w0, s->w0 = w;
    s->r2 = s->r1, s->r1 = r;
    s->ticks += 1;
  }
  s->substeps += 1;
  double part = (s->substeps * h - (s->ticks - 1) * tau) / tau;
  part = part < 0 ? 0 : part > 1 ? 1 : part;
  double before = s->setpoint, motor = (s->w1 + (s->w0 - s->w1) * part) * RAD_S_PER_RPM;
  s->setpoint = is_light(p) ? crossing(s, p, h, motor) : motor;
  s->rise = s->setpoint - before;
}

// ---------------------------------------------------------------------------------------- setpoint to torque

// The free wheel's inertia as a reported torque meets it: its own, and that of the implicit damping.
static double effective_inertia(const double* p, const Substep* now) {
  return p[INERTIA] + (now->implicit ? now->timestep * p[SERVO] : 0);
}

// The motor's speed without load, at which the servo's torque is 0.
static double unloaded(const Drive* s, const double* p) {
  return s->setpoint + p[INTEGRAL_GAIN] / p[SERVO] * s->integral;
}

// The torque that the integrator subtracts from the reported one if the wheel's speed changes as in the last substep.
static double damping(const Drive* s, const double* p, const Substep* now) {
  return now->implicit ? p[SERVO] * s->change : 0;
}

// The torque to report, without its limit.
static double asked_torque(const Drive* s, const double* p, const Substep* now) {
  double h = now->timestep, kv = p[SERVO], half = p[GAP] / 2;
  double motor = unloaded(s, p) + p[INERTIA] * s->rise / (h * kv), rate = motor - now->speed;
  if (!(half > 0) || is_light(p)) return kv * rate;
  // The motor moves a wheel that coasts on only by the part of its travel relative to it that lies beyond the gap.
  double position = s->gap + h * rate, beyond = position - clip(position, -half, half);
  return beyond == 0 ? damping(s, p, now) : kv * beyond / h;
}

// A torque that follows the wheel's angle. It is limited together with the servo's: with a weak motor and a stiff servo,
// a share of its speed is more than the motor can hold, and would drive the wheel away.
static double ripple(const Drive* s, const double* p, const Substep* now) {
  if (!(p[RIPPLE] > 0 || p[RIPPLE_SHARE] > 0)) return 0;
  double size = p[RIPPLE] + p[RIPPLE_SHARE] * p[SERVO] * now->speed;
  return size * sin(p[RIPPLE_PER_TURN] * s->angle + p[RIPPLE_PHASE]);
}

// The torque to report, limited. The implicit integrators subtract kv times the coming change of speed from it,
// which is the servo's damping and leaves a free wheel a fifth of the torque. MuJoCo's forcerange clamps the
// reported torque and drops the damping there, so a free or slipping wheel (kv h / J = 4) overshoots in every
// substep and rings. The limit here applies to the torque that reaches the wheel, with the last change of speed as
// the prediction of the next. The prediction is exact at constant acceleration a, else off by kv h (a - a before).
// After a jump the error shrinks by the factor kv h / (J + kv h) per substep (0.81 for the free wheel, 0.25 for one
// that carries the paper's robot). The factor is never negative, so no inertia makes the wheel ring; a prediction
// that assumes an inertia has no such bound.
//
// Measured on random drives of the packaged robot at 1/480 s: a wheel's speed changes by at most 6.5 rpm in one
// substep (28 rpm with forcerange; 50 rpm back and forth on a slippery floor with twice the limit). While limited,
// the wheel gets 4 % more than the limit on average, and over 1.2 times the limit in 0.3 % of substeps.
//
// A rotor is accelerated beside the limit, which is that of the torque on the rest of the wheel.
static double limited(const Drive* s, const double* p, const Substep* now, double asked) {
  double limit = p[TORQUE_LIMIT], forwards = limit, backwards = limit;
  double off = damping(s, p, now) + p[ROTOR] * s->change / now->timestep;
  if (p[SUPPLY] > 0 && limit < UNLIMITED) {
    // What the supply leaves at this speed.
    double ratio = now->speed / (supplied(p, now) * RAD_S_PER_RPM);
    forwards *= clip(1 - ratio, 0, 1), backwards *= clip(1 + ratio, 0, 1);
  }
  if (asked - off > forwards) return forwards + off;
  if (asked - off < -backwards) return -backwards + off;
  return asked;
}

static double custom_speed(const Drive* s, const double* p, const Substep* now, double speed) {
  Inputs inputs = {s->r1, speed / RAD_S_PER_RPM, s->angle, (s->substeps - 1) * now->timestep, now->lost_v};
  return program_value(PROGRAM(p, AT_LOAD), &inputs) * RAD_S_PER_RPM;
}

// The torque of a custom load: the servo's stiffness times the speed [rad/s] that the formula gives for the wheel's
// speed. A load that falls steeply with speed, as friction does near rest, would make the wheel chatter if it were
// that of the speed at the start of the substep. It is then that of the speed at the end, which is searched between
// the start and the end that the plain load leads to (regula falsi, Illinois variant).
static double custom_torque(const Drive* s, const double* p, const Substep* now, double drive) {
  if (PROGRAM(p, AT_LOAD)[0] == OP_END) return 0;
  double kv = p[SERVO], perstep = now->timestep / fmax(effective_inertia(p, now), TINY);
  double alone = now->speed + perstep * drive, gain = perstep * kv;  // speed at the end without load, and per load
  double low = now->speed, load = custom_speed(s, p, now, low);
  double high = alone + gain * load, at_low = high - low;
  double at_high = alone + gain * custom_speed(s, p, now, high) - high;
  if (!(at_low * at_high < 0 && fabs(at_high) > fmax(0.5 * fabs(at_low), STILL))) return kv * load;
  for (int i = 0; i < ROOT_STEPS; i++) {
    double speed = high - at_high * (high - low) / (at_high - at_low);
    load = custom_speed(s, p, now, speed);
    double here = alone + gain * load - speed;
    if (here * at_high < 0) low = high, at_low = at_high;
    else at_low *= 0.5;
    high = speed, at_high = here;
    if (fabs(here) <= STILL) break;
  }
  return kv * (high - alone) / gain;
}

// The share that is left of a friction of the bearing, of which a warm one has lost `lost`.
static double cold(const Drive* s, const double* p, const Substep* now, double lost) {
  if (!(lost > 0 && p[WARM_TIME] > 0)) return 1;
  double seconds = (s->substeps - 1) * now->timestep;
  return 1 - lost * (1 - exp(-seconds / p[WARM_TIME]));
}

// What a warm bearing has lost of its viscous friction, which the engine's damping of the joint holds at its cold value.
static double thawed(const Drive* s, const double* p, const Substep* now) {
  return p[VISCOUS] * (1 - cold(s, p, now, p[VISCOUS_WARM_SHARE])) * now->speed;
}

// Friction of the wheel's bearing: the torque that brings the wheel to rest in this substep, limited to
// coulomb + breakaway exp(-(speed / stribeck)^2). MuJoCo's frictionloss is not used: its solver knows the bare
// inertia J, while the implicit step moves J + h kv, four times as much and more. It would stop the wheel with too
// small a torque or push it past the setpoint at a reversal (0.517 N m, servo 0.8, setpoint 4.25 rpm: 6.84 rpm
// instead of 0). Here both inertias agree, and the free wheel stops and sticks exactly. With more inertia on it (a
// robot) a substep leaves the share 1 - (J + h kv) / (inertia + h kv) of its speed and never reverses it. Other
// torques on the wheel (a slope) are estimated from its motion and smoothed: without smoothing, wheels that stick
// on the rollers' soft contacts tremble by up to 0.5 rpm per substep, with LOAD_SMOOTHING not at all.
static double friction(const Drive* s, const double* p, const Substep* now, double drive) {
  double share = cold(s, p, now, p[WARM_SHARE]), breakaway = p[BREAKAWAY] * share, coulomb = p[COULOMB] * share;
  double stribeck = p[STRIBECK], limit = coulomb;
  int falling = breakaway > 0 && stribeck > 0;  // friction falls with speed
  if (!(limit > 0 || falling)) return 0;
  double perstep = fmax(effective_inertia(p, now), TINY) / now->timestep, left = now->speed;
  double stop = drive + s->load + left * perstep;
  // Falling friction is that of the speed after the substep, found by iteration from the present one.
  for (int i = 0; i < 3 && falling; i++) {
    double ratio = left / stribeck;
    limit = coulomb + breakaway * exp(-ratio * ratio);
    left = (stop - clip(stop, -limit, limit)) / perstep;
  }
  return -clip(stop, -limit, limit);
}

Torques chain_torques(const Drive* s, const double* p, const Substep* now) {
  Torques t;
  t.asked = asked_torque(s, p, now) + ripple(s, p, now);
  t.drive = limited(s, p, now, t.asked);
  double back = thawed(s, p, now);
  t.custom = custom_torque(s, p, now, t.drive);
  t.friction = back + friction(s, p, now, t.drive + back + t.custom);
  return t;
}

double chain_reported(const Torques* t) { return t->drive + t->friction + t->custom; }

// Viscous friction is the joint's, and does not count here until it warms up.
int chain_is_plain(const double* p) {
  int loaded = p[GAP] > 0 || p[RIPPLE] > 0 || p[RIPPLE_SHARE] > 0 || p[INTEGRAL_GAIN] > 0 || p[COULOMB] > 0 ||
               p[BREAKAWAY] > 0 || p[VISCOUS_WARM_SHARE] > 0 || p[TORQUE_LIMIT] < UNLIMITED;
  for (int i = 0; i < N_STATIONS; i++) loaded |= PROGRAM(p, i)[0] != OP_END;
  return !loaded;
}

double chain_plain_torque(const Drive* s, const double* p, const Substep* now) { return asked_torque(s, p, now); }

void chain_end(Drive* s, const double* p, const Substep* now, double asked, double delivered, double reported,
               double speed) {
  double h = now->timestep, half = p[GAP] / 2;
  s->change = speed - now->speed;
  s->angle += h * speed;
  s->load += LOAD_SMOOTHING * (effective_inertia(p, now) * s->change / h - reported - s->load);
  double before = s->gap;
  // A light wheel has crossed it before the servo, whose setpoint is that of the wheel.
  if (!is_light(p)) s->gap = clip(before + h * (unloaded(s, p) - speed), -half, half);
  // The error of the motor, which turns without the wheel inside the gap.
  double error = s->setpoint - speed - (s->gap - before) / h;
  // While the torque is limited, the integral winds up by a share of the error only, mostly by none.
  int limit = (asked > delivered && error > 0) || (asked < delivered && error < 0);
  s->integral += (limit ? p[SERVO_WINDUP] : 1.0) * h * error;
}
