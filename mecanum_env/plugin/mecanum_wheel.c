// Actuator plugin "mecanum.wheel": one identified wheel drive, command [rpm] in, torque [N m] out.
//
// In each substep n, at time n*h: latch and shape the command when due, tick the wheel law when due, move the
// setpoint linearly from w(k) to w(k+1), and hold it with a (PI) velocity servo:
//
//   w(k+1) = A w(k) + B w(k-1) + C w(k-2) + D r(k) + E r(k-1) + F r(k-2)          [rpm]
//   torque = kv (setpoint - speed) + ki integral(setpoint - speed) dt + J (setpoint's acceleration)   [N m]
//
// limited to torque_limit_n_m. J is the inertia of the free wheel; fed forward, it makes the free wheel follow the
// setpoint without lag. Friction of the wheel's bearing acts beside this torque.
//
// mecanum_env/law/drive.py is the same law in Python; the tests hold the two equal bit for bit.
//
// All parameters are numeric fields of the actuator and read anew at each call, so copies, pickles, batches of
// different models and edits of a compiled model work. All memory is in plugin_state (mecanum_env/plugin/layout.py
// names the entries), written in reset and advance only.

#include <math.h>
#include <stdio.h>
#include <string.h>

#include <mujoco/mujoco.h>

#define PLUGIN_NAME "mecanum.wheel"
#define RING 32              // latched commands kept, which bounds the delay
#define MAX_EVENTS 1024      // law ticks or latches in one substep, at most
#define EPS 1e-9             // tolerance of the clocks, relative to their period
#define LOAD_SMOOTHING 0.1   // share of a change of the load that its estimate follows in a substep
static const double RAD_S_PER_RPM = 2.0 * 3.141592653589793 / 60.0;

enum { SAMPLE_PERIOD = 6, COMMAND_PERIOD, QUANTUM, SATURATION };  // in dynprm, after A..F
enum { INTEGRAL_GAIN, DELAY, TORQUE_LIMIT, NUSER };               // in user; the following may be absent
enum { DEADBAND = NUSER, GAIN, REVERSE_RATIO, DROP, SOFTNESS, ACCELERATION, GAP, BREAKAWAY, STRIBECK,
       COULOMB, INERTIA, LAST_USER };

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
  double command[RING];                            // latched command j at j modulo RING [rpm]
} Drive;

_Static_assert(sizeof(mjtNum) == sizeof(double), "the plugin needs MuJoCo in double precision");
enum { NSTATE = sizeof(Drive) / sizeof(double) };

// Index of command j in the ring; j may be negative (before the start) or, in a state written by hand, anything.
static int slot(double j) {
  double s = fmod(j, RING);
  if (s < 0) s += RING;
  return s >= 0 && s < RING ? (int)s : 0;
}

// A parameter that the model may leave out; 0 means "off" for all of them.
static double option(const mjModel* m, int id, int i) {
  return i < m->nuser_actuator ? m->actuator_user[id * m->nuser_actuator + i] : 0;
}

// The drive's command [rpm] for a received command u [rpm] that acts at a time [s] since the clocks started.
static double shaped(const mjModel* m, int id, double u, double seconds) {
  double gain = option(m, id, GAIN), ratio = option(m, id, REVERSE_RATIO), drop = option(m, id, DROP);
  double limit = m->actuator_dynprm[id * mjNDYN + SATURATION], knee = fmin(option(m, id, SOFTNESS), limit);
  if (fabs(u) < option(m, id, DEADBAND)) u = 0;
  if (gain > 0) u *= gain;
  if (ratio > 0 && u < 0) u *= ratio;
  if (drop > 0) u *= fmax(0, 1 - drop * seconds);
  if (limit > 0 && knee > 0) {
    double beyond = fabs(u) - (limit - knee);
    // The soft knee is a parabola that leaves the line with slope 1 and reaches the limit with slope 0.
    if (beyond > 0 && beyond < 2 * knee) u = copysign(limit - knee + beyond - beyond * beyond / (4 * knee), u);
  }
  if (limit > 0) u = fmin(fmax(u, -limit), limit);
  return u;
}

// The latched command; NaN and absurd values count as 0, as for MuJoCo's own actuators.
static double latch(const mjModel* m, const mjData* d, int id, double seconds) {
  const mjtNum* p = m->actuator_dynprm + id * mjNDYN;
  int adr = m->actuator_ctrladr[id];
  double u = d->ctrl[adr];
  if (!(fabs(u) <= mjMAXVAL)) u = 0;
  if (m->actuator_ctrllimited[adr] && !(m->opt.disableflags & mjDSBL_CLAMPCTRL))
    u = mju_clip(u, m->actuator_ctrlrange[2 * adr], m->actuator_ctrlrange[2 * adr + 1]);
  if (p[QUANTUM] > 0) u = rint(u / p[QUANTUM]) * p[QUANTUM];
  return shaped(m, id, u, seconds);
}

// Move the ramp towards a command for a part of a tick; return the part's contribution to the mean over the tick.
// The ramp changes by at most `limit` in a whole tick; with 0 it jumps.
static double ramped(double* ramp, double command, double part, double limit) {
  if (!(limit > 0)) return *ramp = command, part * command;
  double before = *ramp;
  *ramp = fmin(fmax(command, before - limit * part), before + limit * part);
  double moved = *ramp - before;
  return part * *ramp - moved * fabs(moved) / (2 * limit);
}

// r(k): the mean over the tick of the delayed command behind the acceleration limit. Only commands latched by the
// start of the tick count.
static double law_input(Drive* s, double tau, double T, double delay, double limit) {
  double t = s->ticks * tau;
  double latest = floor(t / T + EPS);
  if (!(latest <= s->latches - 1)) latest = s->latches - 1;
  double j = floor((t - delay) / T + EPS);
  if (!(j <= latest)) j = latest;
  if (j < latest - (RING - 1)) j = latest - (RING - 1);
  double sum = 0, done = 0;
  for (int i = 1; i < RING && j + 1 <= latest; i++, j++) {
    double arrival = (j + 1) * T + delay;
    if (!(arrival < t + tau)) break;
    double part = (arrival - t) / tau;
    sum += ramped(&s->ramp, s->command[slot(j)], part - done, limit);
    done = part;
  }
  return sum + ramped(&s->ramp, s->command[slot(j)], 1 - done, limit);
}

// The drive at the end of this substep, except for integral, change, gap and load, which `wheel_advance` updates.
static Drive after_substep(const mjModel* m, const mjData* d, int id, const mjtNum* state) {
  const mjtNum* p = m->actuator_dynprm + id * mjNDYN;
  const double h = m->opt.timestep, tau = p[SAMPLE_PERIOD], T = p[COMMAND_PERIOD];
  const double delay = m->actuator_user[id * m->nuser_actuator + DELAY];
  const double limit = option(m, id, ACCELERATION) * tau;  // change of the ramp per tick
  Drive s;
  memcpy(&s, state, sizeof s);

  if (s.timestep != h || s.sample_period != tau || s.command_period != T) {
    double last = s.command[slot(s.latches - 1)];
    for (int i = 0; i < RING; i++) s.command[i] = last;
    s.substeps = s.ticks = s.latches = 0;
    s.timestep = h, s.sample_period = tau, s.command_period = T;
    s.change = 0;  // that of a substep of the old length
  }
  double now = s.substeps * h;
  for (int i = 0; i < MAX_EVENTS && now >= s.latches * T - EPS * T; i++) {
    s.command[slot(s.latches)] = latch(m, d, id, s.latches * T + delay);
    s.latches += 1;
  }
  for (int i = 0; i < MAX_EVENTS && now >= s.ticks * tau - EPS * tau; i++) {
    double r = law_input(&s, tau, T, delay, limit);
    double w = p[0] * s.w0 + p[1] * s.w1 + p[2] * s.w2 + p[3] * r + p[4] * s.r1 + p[5] * s.r2;
    s.w2 = s.w1, s.w1 = s.w0, s.w0 = w;
    s.r2 = s.r1, s.r1 = r;
    s.ticks += 1;
  }
  s.substeps += 1;
  double part = (s.substeps * h - (s.ticks - 1) * tau) / tau;
  part = part < 0 ? 0 : part > 1 ? 1 : part;
  double before = s.setpoint;
  s.setpoint = (s.w1 + (s.w0 - s.w1) * part) * RAD_S_PER_RPM;
  s.rise = s.setpoint - before;
  return s;
}

static double stiffness(const mjModel* m, int id) { return -m->actuator_biasprm[id * mjNBIAS + 2]; }

static double speed(const mjModel* m, const mjData* d, int id) { return d->actuator_velocity[m->actuator_outadr[id]]; }

// Whether the integrator subtracts kv times the coming change of speed from the torque.
static int implicit(const mjModel* m) {
  return m->opt.integrator == mjINT_IMPLICIT || m->opt.integrator == mjINT_IMPLICITFAST;
}

// The free wheel's inertia as a reported torque meets it: its own, and that of the implicit damping.
static double effective_inertia(const mjModel* m, int id) {
  return option(m, id, INERTIA) + (implicit(m) ? m->opt.timestep * stiffness(m, id) : 0);
}

// The motor's speed without load, at which the servo's torque is 0.
static double unloaded(const mjModel* m, int id, const Drive* s) {
  double ki = m->actuator_user[id * m->nuser_actuator + INTEGRAL_GAIN];
  return s->setpoint + ki / stiffness(m, id) * s->integral;
}

// The torque that the integrator subtracts from the reported one if the wheel's speed changes as in the last substep.
static double damping(const mjModel* m, int id, const Drive* s) {
  return implicit(m) ? stiffness(m, id) * s->change : 0;
}

// The torque to report, without its limit.
static double asked_torque(const mjModel* m, const mjData* d, int id, const Drive* s) {
  double h = m->opt.timestep, kv = stiffness(m, id), half = option(m, id, GAP) / 2;
  double rate = unloaded(m, id, s) + option(m, id, INERTIA) * s->rise / (h * kv) - speed(m, d, id);
  if (!(half > 0)) return kv * rate;
  // The motor moves the wheel only by the part of its travel that lies beyond the gap.
  double position = s->gap + h * rate, beyond = position - mju_clip(position, -half, half);
  return beyond == 0 ? damping(m, id, s) : kv * beyond / h;
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
static double torque(const mjModel* m, const mjData* d, int id, const Drive* s) {
  double limit = m->actuator_user[id * m->nuser_actuator + TORQUE_LIMIT];
  double asked = asked_torque(m, d, id, s), off = damping(m, id, s);
  if (asked - off > limit) return limit + off;
  if (asked - off < -limit) return -limit + off;
  return asked;
}

// Friction of the wheel's bearing: the torque that brings the wheel to rest in this substep, limited to
// coulomb + breakaway exp(-(speed / stribeck)^2). MuJoCo's frictionloss is not used: its solver knows the bare
// inertia J, while the implicit step moves J + h kv, four times as much and more. It would stop the wheel with too
// small a torque or push it past the setpoint at a reversal (0.517 N m, servo 0.8, setpoint 4.25 rpm: 6.84 rpm
// instead of 0). Here both inertias agree, and the free wheel stops and sticks exactly. With more inertia on it (a
// robot) a substep leaves the share 1 - (J + h kv) / (inertia + h kv) of its speed and never reverses it. Other
// torques on the wheel (a slope) are estimated from its motion and smoothed: without smoothing, wheels that stick
// on the rollers' soft contacts tremble by up to 0.5 rpm per substep, with LOAD_SMOOTHING not at all.
static double friction(const mjModel* m, const mjData* d, int id, const Drive* s, double drive) {
  double breakaway = option(m, id, BREAKAWAY), stribeck = option(m, id, STRIBECK), limit = option(m, id, COULOMB);
  int falling = breakaway > 0 && stribeck > 0;  // friction falls with speed
  if (!(limit > 0 || falling)) return 0;
  double perstep = fmax(effective_inertia(m, id), mjMINVAL) / m->opt.timestep, left = speed(m, d, id);
  double stop = drive + s->load + left * perstep;
  // Falling friction is that of the speed after the substep, found by iteration from the present one.
  for (int i = 0; i < 3 && falling; i++) {
    double ratio = left / stribeck;
    limit = option(m, id, COULOMB) + breakaway * exp(-ratio * ratio);
    left = (stop - mju_clip(stop, -limit, limit)) / perstep;
  }
  return -mju_clip(stop, -limit, limit);
}

// The actuator's speed from qvel; d->actuator_velocity is still that of the start of the substep.
static double speed_now(const mjData* d, int out) {
  int first = d->moment_rowadr[out];
  double speed = 0;
  for (int i = first; i < first + d->moment_rownnz[out]; i++)
    speed += d->actuator_moment[i] * d->qvel[d->moment_colind[i]];
  return speed;
}

// The actuator of a plugin instance; -1 if it has none or several.
static int actuator_of(const mjModel* m, int instance) {
  int id = -1;
  for (int i = 0; i < m->nactuator; i++) {
    if (m->actuator_plugin[i] != instance) continue;
    if (id >= 0) return -1;
    id = i;
  }
  return id;
}

static void wheel_compute(const mjModel* m, mjData* d, int instance, int capability) {
  (void)capability;
  int id = actuator_of(m, instance);
  if (id < 0) return;
  Drive s = after_substep(m, d, id, d->plugin_state + m->plugin_stateadr[instance]);
  double drive = torque(m, d, id, &s);
  d->actuator_force[m->actuator_outadr[id]] = drive + friction(m, d, id, &s, drive);
}

static void wheel_advance(const mjModel* m, mjData* d, int instance) {
  int id = actuator_of(m, instance);
  if (id < 0) return;
  mjtNum* state = d->plugin_state + m->plugin_stateadr[instance];
  Drive s = after_substep(m, d, id, state);
  int out = m->actuator_outadr[id];
  double h = m->opt.timestep, half = option(m, id, GAP) / 2;
  double asked = asked_torque(m, d, id, &s), drive = torque(m, d, id, &s);
  // While actuation is disabled, MuJoCo has cleared the force, and the drive delivers nothing.
  double delivered = d->actuator_force[out] == drive + friction(m, d, id, &s, drive) ? drive : 0;
  // MuJoCo has advanced qvel already. Read here rather than in the next substep, so that a speed set by hand in
  // between does not count as acceleration.
  double now = speed_now(d, out);
  s.change = now - d->actuator_velocity[out];
  s.load += LOAD_SMOOTHING * (effective_inertia(m, id) * s.change / h - d->actuator_force[out] - s.load);
  double before = s.gap;
  s.gap = mju_clip(before + h * (unloaded(m, id, &s) - now), -half, half);
  // The error of the motor, which turns without the wheel inside the gap.
  double error = s.setpoint - now - (s.gap - before) / h;
  // The integral does not wind up while the torque is limited.
  int limited = (asked > delivered && error > 0) || (asked < delivered && error < 0);
  if (!limited) s.integral += h * error;
  memcpy(state, &s, sizeof s);
}

static void wheel_reset(const mjModel* m, mjtNum* state, void* data, int instance) {
  (void)m, (void)data, (void)instance;
  memset(state, 0, sizeof(Drive));
}

static int wheel_nstate(const mjModel* m, int instance) {
  (void)m, (void)instance;
  return NSTATE;
}

// ---------------------------------------------------------------------------------------- checks

#define REFUSE(...) return mju_warning(__VA_ARGS__), -1

static int wheel_init(const mjModel* m, mjData* d, int instance) {
  d->plugin_data[instance] = 0;
  int id = actuator_of(m, instance);
  if (id < 0) REFUSE(PLUGIN_NAME ": instance %d has no actuator or several; one instance drives one wheel", instance);
  char name[100];
  const char* given = mj_id2name(m, mjOBJ_ACTUATOR, id);
  if (given && given[0]) snprintf(name, sizeof name, "%s", given);
  else snprintf(name, sizeof name, "#%d", id);

  static const char* const names[] = {"A", "B", "C", "D", "E", "F", "sample_period_s", "command_period_s",
                                      "command_quantum_rpm", "saturation_rpm"};
  const mjtNum* p = m->actuator_dynprm + id * mjNDYN;
  for (int i = 0; i <= SATURATION; i++) {
    int positive = i == SAMPLE_PERIOD || i == COMMAND_PERIOD;
    if (isfinite(p[i]) && (i < SAMPLE_PERIOD || p[i] > 0 || (!positive && p[i] == 0))) continue;
    REFUSE(PLUGIN_NAME ", actuator \"%s\": %s = dynprm[%d] = %g, must be a finite number%s", name, names[i], i, p[i],
           i < SAMPLE_PERIOD ? "" : positive ? " above 0" : " not below 0 (0: off)");
  }
  double A = p[0], B = p[1], C = p[2];
  if (!(1 - A - B - C > 0 && 3 + A + B - 3 * C > 0 && 1 + A - B + C > 0 && 1 + B + A * C - C * C > 0))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": the wheel law is unstable (A, B, C = %g, %g, %g); all roots of "
           "z^3 - A z^2 - B z - C must lie inside the unit circle", name, A, B, C);
  if (m->actuator_dyntype[id] != mjDYN_NONE)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": dyntype must be none; dynprm holds the wheel law", name);

  const mjtNum* bias = m->actuator_biasprm + id * mjNBIAS;
  double kv = 0 - bias[2];
  if (m->actuator_biastype[id] != mjBIAS_AFFINE || bias[0] != 0 || bias[1] != 0 || !isfinite(kv) || !(kv > 0))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": servo_n_m_s_rad = -biasprm[2] = %g, must be a finite number above 0, with "
           "biastype=\"affine\" biasprm=\"0 0 -servo\" in the actuator's default class", name, kv);
  if (m->nuser_actuator < NUSER)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": nuser_actuator = %d, must be at least %d (user = servo_integral_n_m_rad, "
           "delay_s, torque_limit_n_m; mecanum_env writes 16)", name, (int)m->nuser_actuator, NUSER);
  const mjtNum* user = m->actuator_user + id * m->nuser_actuator;
  if (!isfinite(user[INTEGRAL_GAIN]) || user[INTEGRAL_GAIN] < 0)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": servo_integral_n_m_rad = user[%d] = %g, must be a finite number not below 0",
           name, INTEGRAL_GAIN, user[INTEGRAL_GAIN]);
  double h = m->opt.timestep, longest = (RING - 3) * p[COMMAND_PERIOD] - h;
  if (!(h <= MAX_EVENTS * p[SAMPLE_PERIOD]) || !(longest >= 0))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": timestep = %g s, must be at most %d sample periods of %g s and %d command "
           "periods of %g s", name, h, MAX_EVENTS, p[SAMPLE_PERIOD], RING - 3, p[COMMAND_PERIOD]);
  if (!(user[DELAY] >= 0) || !(user[DELAY] <= longest))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": delay_s = user[%d] = %g, must be 0 to %g (%d command periods less a "
           "timestep)", name, DELAY, user[DELAY], longest, RING - 3);
  if (!(user[TORQUE_LIMIT] > 0))
    REFUSE(PLUGIN_NAME ", actuator \"%s\": torque_limit_n_m = user[%d] = %g, must be above 0 (1e10 or inf: no limit)",
           name, TORQUE_LIMIT, user[TORQUE_LIMIT]);
  static const char* const options[] = {"command_deadband.threshold_rpm", "gain", "reverse_ratio",
                                        "battery_sag.drop_per_s", "speed_saturation.softness_rpm",
                                        "acceleration_limit.limit_rpm_s", "backlash, in rad",
                                        "stiction.breakaway_n_m", "stiction.stribeck, in rad/s",
                                        "coulomb_friction.torque_n_m", "the wheel's inertia, in kg m^2"};
  for (int i = DEADBAND; i < LAST_USER; i++)
    if (!(option(m, id, i) >= 0) || !isfinite(option(m, id, i)))
      REFUSE(PLUGIN_NAME ", actuator \"%s\": %s = user[%d] = %g, must be a finite number not below 0 (0: off)", name,
             options[i - DEADBAND], i, option(m, id, i));
  if (m->actuator_forcelimited[id])
    REFUSE(PLUGIN_NAME ", actuator \"%s\": forcerange is MuJoCo's own limit, with which a free wheel rings; write "
           "forcelimited=\"false\" and the limit to user[%d]", name, TORQUE_LIMIT);
  if (m->actuator_history[2 * id] > 0 || m->actuator_delay[id] != 0)
    REFUSE(PLUGIN_NAME ", actuator \"%s\": nsample and delay are MuJoCo's own delay, which this plugin does not use; "
           "write the delay to user[%d]", name, DELAY);
  return 0;
}

mjPLUGIN_LIB_INIT(mecanum_wheel) {
  mjpPlugin plugin;
  mjp_defaultPlugin(&plugin);
  plugin.name = PLUGIN_NAME;
  plugin.capabilityflags = mjPLUGIN_ACTUATOR;
  plugin.needstage = mjSTAGE_VEL;
  plugin.nstate = wheel_nstate;
  plugin.init = wheel_init;
  plugin.reset = wheel_reset;
  plugin.compute = wheel_compute;
  plugin.advance = wheel_advance;
  mjp_registerPlugin(&plugin);
}
